// Line protocol of the bench instruments, version 2: ASCII lines "text*CCCC", CCCC the CRC-16/CCITT-FALSE of
// the text. docs/bench_instruments.md describes it. The same file lies beside both sketches, because the
// Arduino tools look nowhere else.
#pragma once
#include <Arduino.h>

const uint32_t BAUD = 115200;
const uint32_t HEARTBEAT_US = 100000;
const uint8_t TAG_MAX = 16;
const uint8_t TICK_US = 4;  // resolution of micros() at 16 MHz

static uint16_t lineCrc;
static uint16_t nextSeq;

static inline void putChar(char c) {
  lineCrc ^= (uint16_t)(uint8_t)c << 8;
  for (uint8_t bit = 0; bit < 8; bit++) {
    lineCrc = lineCrc & 0x8000 ? (uint16_t)(lineCrc << 1 ^ 0x1021) : (uint16_t)(lineCrc << 1);
  }
  Serial.write((uint8_t)c);
}

static inline void putText(const char *text) {
  while (*text) putChar(*text++);
}

static inline void putNumber(uint32_t value) {
  char digits[11];
  uint8_t at = sizeof digits - 1;
  digits[at] = '\0';
  do {
    digits[--at] = (char)('0' + value % 10);
    value /= 10;
  } while (value);
  putChar(',');
  putText(digits + at);
}

static inline void putSigned(int32_t value) {
  if (value >= 0) {
    putNumber((uint32_t)value);
    return;
  }
  char digits[12];
  uint8_t at = sizeof digits - 1;
  uint32_t rest = (uint32_t)0 - (uint32_t)value;
  digits[at] = '\0';
  do {
    digits[--at] = (char)('0' + rest % 10);
    rest /= 10;
  } while (rest);
  putText(",-");
  putText(digits + at);
}

// Begin a numbered line: its letter, its number, its time.
static inline void beginLine(char letter, uint32_t time) {
  lineCrc = 0xFFFF;
  putChar(letter);
  putNumber(nextSeq++);
  putNumber(time);
}

static inline void endLine() {
  const uint16_t crc = lineCrc;
  Serial.write((uint8_t)'*');
  for (int8_t shift = 12; shift >= 0; shift -= 4) {
    const uint8_t digit = crc >> shift & 0xF;
    Serial.write((uint8_t)(digit < 10 ? '0' + digit : 'A' + digit - 10));
  }
  Serial.write((uint8_t)'\n');
}

static inline void sendBanner(const char *kind, const char *firmware, const char *uid) {
  lineCrc = 0xFFFF;
  putText("I,2,");
  putText(kind);
  putChar(',');
  putText(firmware);
  putChar(',');
  putText(uid);
  putNumber(TICK_US);
  endLine();
}

static inline void sendMark(uint32_t time, const char *tag) {
  beginLine('M', time);
  putChar(',');
  putText(tag);
  endLine();
}

// What the sketch does when the host sends '?' or 'S' and 'P'.
static void onIdentify();
static void onRun(bool run);

static char tag[TAG_MAX + 1];
static uint8_t tagLength;
static uint32_t tagTime;
static bool readingTag;

static inline bool isTagChar(char c) {
  return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '_' || c == '.' ||
         c == '-';
}

// Take what the host has sent: '?', 'S', 'P', or 'M<tag>' with a line end. A mark has the time of its M.
static inline void readCommands() {
  while (Serial.available() > 0) {
    const char c = (char)Serial.read();
    if (readingTag) {
      if (isTagChar(c) && tagLength < TAG_MAX) {
        tag[tagLength++] = c;
        continue;
      }
      readingTag = false;
      tag[tagLength] = '\0';
      if (tagLength > 0 && (c == '\n' || c == '\r')) sendMark(tagTime, tag);
    } else if (c == 'M') {
      tagTime = micros();
      tagLength = 0;
      readingTag = true;
    } else if (c == '?') {
      onIdentify();
    } else if (c == 'S' || c == 'P') {
      onRun(c == 'S');
    }
  }
}
