/* The app's memory as the ground sees it (type 0x18): the staged bundle at 0, the recorder from 0x10000 on. */
#ifndef PERCH_MEMORY_H
#define PERCH_MEMORY_H

#include "core.h"

enum { PERCH_BUNDLE_ADDRESS = 0, PERCH_RECORD_ADDRESS = 0x10000 };

/* Bytes from 0 to the end of the last region. */
uint32_t perch_memory_size(void);

/* Read `length` bytes; false, and nothing is read, where they are not all in one region. */
bool perch_memory_read(const perch_core *core, uint32_t address, uint32_t length, void *bytes);

/* Write to the staged bundle; false, and nothing is written, elsewhere, while `flying`, and while a policy is being
 * committed. For one task. */
bool perch_memory_write(perch_core *core, uint32_t address, uint32_t length, const void *bytes, bool flying);

#endif
