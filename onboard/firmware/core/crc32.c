#include "crc32.h"

/* Remainders of the reflected polynomial 0xEDB88320, for four bits at a time: 64 bytes of flash. */
static const uint32_t REMAINDERS[16] = {
    0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4, 0x4db26158, 0x5005713c,
    0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c, 0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c,
};

uint32_t perch_crc32(uint32_t crc, const void *bytes, size_t length) {
  const uint8_t *byte = bytes;
  uint32_t remainder = ~crc;
  for (size_t i = 0; i < length; i++) {
    remainder ^= byte[i];
    remainder = (remainder >> 4) ^ REMAINDERS[remainder & 15u];
    remainder = (remainder >> 4) ^ REMAINDERS[remainder & 15u];
  }
  return ~remainder;
}
