// What the sketches use of the Arduino core, on a PC with simulated time. Compiled with sketch_host.cpp.
#pragma once
#include <stdint.h>

const uint8_t LOW = 0, HIGH = 1;
const uint8_t INPUT = 0, OUTPUT = 1, INPUT_PULLUP = 2, FALLING = 2;

uint32_t micros();
void delayMicroseconds(unsigned us);
void noInterrupts();
void interrupts();
void pinMode(uint8_t pin, uint8_t mode);
int digitalRead(uint8_t pin);
void digitalWrite(uint8_t pin, uint8_t value);
inline int digitalPinToInterrupt(int pin) { return pin - 2; }
void attachInterrupt(int number, void (*handler)(), int mode);

struct SerialPort {
  void begin(uint32_t baud);
  int available();
  int read();
  void write(uint8_t byte);
};
extern SerialPort Serial;

void setup();
void loop();
