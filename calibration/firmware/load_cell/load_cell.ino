// Load cell for Arduino boards of the Uno class: passes on every conversion of an HX711 amplifier.
// DOUT on pin 3, SCK on pin 2, 5 V, ground. Wiring: docs/bench_instruments.md.
#include "line_protocol.h"

const char FIRMWARE[] = "1.0";
const char UID[] = "load-1";  // give every board its own
const uint8_t SCK_PIN = 2, DOUT_PIN = 3;
const uint8_t GAIN_PULSES = 1;  // one pulse more than 24: channel A, gain 128
const uint32_t QUIET_US = 500000;
const uint32_t CONVERSION_MIN_US = 5000;  // 80 a second take 12.5 ms; sooner the data line is stuck low
const uint8_t CODE_NOT_READY = 1;

static bool running;
static uint32_t conversions, lastConversion, lastBeat;

// SCK high for more than 60 us would power the amplifier down: no interrupts meanwhile.
static int32_t readAmplifier() {
  uint32_t value = 0;
  noInterrupts();
  for (uint8_t bit = 0; bit < 24 + GAIN_PULSES; bit++) {
    digitalWrite(SCK_PIN, HIGH);
    delayMicroseconds(1);
    if (bit < 24) value = value << 1 | (digitalRead(DOUT_PIN) == HIGH ? 1 : 0);
    digitalWrite(SCK_PIN, LOW);
    delayMicroseconds(1);
  }
  interrupts();
  return value & 0x800000 ? (int32_t)value - 0x1000000 : (int32_t)value;
}

static void sendConversion(uint32_t time) {
  const int32_t raw = readAmplifier();
  conversions++;
  if (!running) return;
  beginLine('L', time);
  putSigned(raw);
  endLine();
}

static void sendHeartbeat() {
  beginLine('H', micros());
  putNumber(conversions);
  putNumber(0);
  putNumber(digitalRead(DOUT_PIN));
  endLine();
}

static void onIdentify() {
  sendBanner("load", FIRMWARE, UID);
}

static void onRun(bool run) {
  running = run;
}

void setup() {
  Serial.begin(BAUD);
  pinMode(SCK_PIN, OUTPUT);
  digitalWrite(SCK_PIN, LOW);
  pinMode(DOUT_PIN, INPUT_PULLUP);  // without an amplifier the line is high: never ready
  onIdentify();
  lastBeat = lastConversion = micros();
}

void loop() {
  readCommands();
  const uint32_t now = micros();
  const uint32_t since = now - lastConversion;
  if (digitalRead(DOUT_PIN) == LOW && since >= CONVERSION_MIN_US) {
    lastConversion = now;
    sendConversion(now);
  } else if (since >= QUIET_US) {
    lastConversion = now;
    beginLine('X', now);
    putNumber(CODE_NOT_READY);
    putText(",hx711 not ready");
    endLine();
  }
  if (micros() - lastBeat >= HEARTBEAT_US) {
    lastBeat += HEARTBEAT_US;
    sendHeartbeat();
  }
}
