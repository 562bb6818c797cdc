// Tachometer for Arduino boards of the Uno class: stamps every falling edge of an infra-red reflex sensor.
// Sensor output on pin 2 (open collector: pull-up is on), 5 V, ground. Wiring: docs/bench_instruments.md.
#include "line_protocol.h"

const char FIRMWARE[] = "1.0";
const char UID[] = "tach-1";  // give every board its own
const uint8_t SENSOR_PIN = 2;
const uint16_t GLITCH_US = 200;  // 5000 edges a second is faster than any small propeller
const uint32_t FLUSH_US = 50000;
const uint8_t GROUP = 8;
const uint8_t RING = 64;  // a power of two; 77 ms at the fastest speed

static volatile uint32_t ring[RING];
static volatile uint8_t ringHead, ringTail;
static volatile uint32_t edgesTotal, overflows, lastEdge;
static volatile bool running;

// Only the interrupt moves the head, only the loop the tail.
static void onEdge() {
  const uint32_t now = micros();
  if (!running || now - lastEdge < GLITCH_US) return;
  lastEdge = now;
  edgesTotal++;
  const uint8_t next = (ringHead + 1) & (RING - 1);
  if (next == ringTail) {
    overflows++;
    return;
  }
  ring[ringHead] = now;
  ringHead = next;
}

static uint8_t edgesWaiting() {
  return (uint8_t)(ringHead - ringTail) & (RING - 1);
}

// One E line of up to eight edges.
static void sendGroup(uint8_t count) {
  uint32_t times[GROUP] = {0};
  noInterrupts();
  for (uint8_t i = 0; i < count; i++) times[i] = ring[(ringTail + i) & (RING - 1)];
  ringTail = (ringTail + count) & (RING - 1);
  interrupts();
  beginLine('E', times[0]);
  for (uint8_t i = 1; i < count; i++) putNumber(times[i] - times[i - 1]);
  endLine();
}

static void sendEdges() {
  while (edgesWaiting() >= GROUP) sendGroup(GROUP);
  const uint8_t waiting = edgesWaiting();
  if (waiting == 0) return;
  noInterrupts();
  const uint32_t age = micros() - ring[ringTail];
  interrupts();
  if (age >= FLUSH_US) sendGroup(waiting < GROUP ? waiting : GROUP);
}

static void sendHeartbeat() {
  noInterrupts();
  const uint32_t now = micros(), total = edgesTotal, lost = overflows;
  interrupts();
  beginLine('H', now);
  putNumber(total);
  putNumber(lost);
  putNumber(digitalRead(SENSOR_PIN));
  endLine();
}

static void onIdentify() {
  sendBanner("tach", FIRMWARE, UID);
}

static void onRun(bool run) {
  noInterrupts();
  running = run;
  interrupts();
}

static uint32_t lastBeat;

void setup() {
  Serial.begin(BAUD);
  pinMode(SENSOR_PIN, INPUT_PULLUP);
  attachInterrupt(digitalPinToInterrupt(SENSOR_PIN), onEdge, FALLING);
  onIdentify();
  lastBeat = micros();
}

void loop() {
  readCommands();
  sendEdges();
  if (micros() - lastBeat >= HEARTBEAT_US) {
    lastBeat += HEARTBEAT_US;
    sendHeartbeat();
  }
}
