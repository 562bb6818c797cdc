/* Files of the host and the end of the run, by Arm's semihosting calls. */
#ifndef SEMIHOSTING_H
#define SEMIHOSTING_H

#include <stdint.h>

static inline int32_t semihosting(uint32_t operation, const void *arguments) {
  register uint32_t r0 __asm__("r0") = operation;
  register const void *r1 __asm__("r1") = arguments;
  __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
  return (int32_t)r0;
}

/* SYS_OPEN in mode "rb" (1) or "wb" (5). */
static inline int32_t semihosting_open(const char *name, uint32_t length, uint32_t mode) {
  const uintptr_t block[3] = {(uintptr_t)name, mode, length};
  return semihosting(0x01, block);
}

/* SYS_READ: 0 when all was read. */
static inline int32_t semihosting_read(int32_t file, void *bytes, uint32_t length) {
  const uintptr_t block[3] = {(uintptr_t)file, (uintptr_t)bytes, length};
  return semihosting(0x06, block);
}

/* SYS_WRITE: 0 when all was written. */
static inline int32_t semihosting_write(int32_t file, const void *bytes, uint32_t length) {
  const uintptr_t block[3] = {(uintptr_t)file, (uintptr_t)bytes, length};
  return semihosting(0x05, block);
}

/* SYS_EXIT_EXTENDED: ADP_Stopped_ApplicationExit with a code. */
static inline void semihosting_exit(int code) {
  const uint32_t block[2] = {0x20026, (uint32_t)code};
  semihosting(0x20, block);
  for (;;) {
  }
}

#endif
