/* CRC-32 as zlib, Ethernet and PNG have it. */
#ifndef PERCH_CRC32_H
#define PERCH_CRC32_H

#include <stddef.h>
#include <stdint.h>

/* CRC of `length` bytes after those that gave `crc` (0: none). */
uint32_t perch_crc32(uint32_t crc, const void *bytes, size_t length);

#endif
