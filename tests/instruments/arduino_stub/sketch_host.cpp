// Runs a sketch on a PC: simulated time, a UART that sends 115200 baud through a buffer of 64 bytes, one
// interrupt pin and an HX711. The script on standard input is sorted by time (us):
//   B <first micros()>   E <t> falling edge   C <t> <text> host sends text and LF   A <t> <raw> conversion
//   N <t> <busy> the loop is held up for so long (us)   Q <t> end
// What the sketch sends goes to standard output.
#include <stdio.h>

#include <deque>
#include <sstream>
#include <string>

#include "Arduino.h"

struct Action {
  char kind;
  double time;
  std::string text;
};

static std::deque<Action> script;
static std::deque<char> incoming;
static std::deque<uint8_t> outgoing;
static double now = 0, sentUntil = 0;
static uint32_t firstMicros = 0;
static double byteUs = 0;
static void (*handler)() = nullptr;
static bool masked = false, edgePending = false, ended = false;
static bool converted = false;
static uint32_t raw = 0;
static int bitsLeft = 0, sck = 0;
static double busy = 0;

static void transmit() {
  if (outgoing.empty()) sentUntil = now;
  while (!outgoing.empty() && sentUntil + byteUs <= now) {
    sentUntil += byteUs;
    putchar(outgoing.front());
    outgoing.pop_front();
  }
}

static void fire() {
  edgePending = false;
  if (handler) handler();
}

static void perform(const Action &action) {
  switch (action.kind) {
    case 'E':
      if (masked) edgePending = true;
      else fire();
      break;
    case 'C':
      for (char c : action.text) incoming.push_back(c);
      incoming.push_back('\n');
      break;
    case 'A':
      raw = (uint32_t)std::stol(action.text) & 0xFFFFFF;
      bitsLeft = 24;
      converted = true;
      break;
    case 'N':
      busy = std::stod(action.text);
      break;
    case 'Q':
      ended = true;
      break;
  }
}

static void pass(double us) {
  const double end = now + us;
  while (!script.empty() && script.front().time <= end) {
    const Action action = script.front();
    script.pop_front();
    if (action.time > now) now = action.time;
    perform(action);
  }
  now = end;
  transmit();
}

uint32_t micros() { return firstMicros + (uint32_t)((uint64_t)now / 4 * 4); }
void delayMicroseconds(unsigned us) { pass(us); }
void noInterrupts() { masked = true; }
void interrupts() {
  masked = false;
  if (edgePending) fire();
}
void pinMode(uint8_t, uint8_t) {}
void attachInterrupt(int, void (*function)(), int) { handler = function; }
int digitalRead(uint8_t) {
  if (!converted) return HIGH;
  return sck && bitsLeft >= 0 ? (int)(raw >> bitsLeft & 1) : LOW;
}
void digitalWrite(uint8_t, uint8_t value) {
  if (value && !sck) bitsLeft--;
  sck = value;
  if (!value && converted && bitsLeft < 0) converted = false;
}

SerialPort Serial;
void SerialPort::begin(uint32_t baud) { byteUs = 10e6 / baud; }
int SerialPort::available() { return (int)incoming.size(); }
int SerialPort::read() {
  if (incoming.empty()) return -1;
  const char c = incoming.front();
  incoming.pop_front();
  return (uint8_t)c;
}
void SerialPort::write(uint8_t byte) {
  while (outgoing.size() >= 64) pass(4);
  if (outgoing.empty()) sentUntil = now;
  outgoing.push_back(byte);
  pass(1);
}

#include SKETCH

int main() {
  char line[256];
  while (fgets(line, sizeof line, stdin)) {
    std::istringstream words(line);
    Action action;
    words >> action.kind;
    if (action.kind == 'B') {
      words >> firstMicros;
      continue;
    }
    words >> action.time >> action.text;
    script.push_back(action);
  }
  setup();
  while (!ended) {
    loop();
    const double held = busy;
    busy = 0;
    pass(20 + held);
  }
  while (!outgoing.empty()) pass(byteUs);
  return 0;
}
