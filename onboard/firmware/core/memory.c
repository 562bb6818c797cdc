#include "memory.h"

#include <string.h>

#include "order.h"

/* Whether `length` bytes from `address` on are in a region, whatever the sum of both would be. */
static bool is_in(uint32_t address, uint32_t length, uint32_t begin, uint32_t size) {
  return address >= begin && address - begin <= size && length <= size - (address - begin);
}

uint32_t perch_memory_size(void) { return PERCH_RECORD_ADDRESS + (uint32_t)sizeof(perch_recorder); }

bool perch_memory_read(const perch_core *core, uint32_t address, uint32_t length, void *bytes) {
  if (is_in(address, length, PERCH_BUNDLE_ADDRESS, sizeof core->staged)) {
    memcpy(bytes, core->staged.bytes + address, length);
    return true;
  }
  if (is_in(address, length, PERCH_RECORD_ADDRESS, sizeof core->recorder)) {
    memcpy(bytes, (const uint8_t *)&core->recorder + (address - PERCH_RECORD_ADDRESS), length);
    return true;
  }
  return false;
}

bool perch_memory_write(perch_core *core, uint32_t address, uint32_t length, const void *bytes, bool flying) {
  if (flying || !is_in(address, length, PERCH_BUNDLE_ADDRESS, sizeof core->staged)) {
    return false;
  }
  /* Said first and then asked, here and in perch_commit(): whichever of the two tasks interrupts the other, at least
   * one of them sees it and refuses. */
  core->stages = true;
  perch_in_this_order();
  const bool is_free = !core->commits;
  if (is_free) {
    memcpy(core->staged.bytes + address, bytes, length);
  }
  perch_in_this_order();
  core->stages = false;
  return is_free;
}
