/* The app's memory: staged policy and recorder, as the host's memory packets reach them.
 *
 * The firmware hands over what a packet says, unchecked, with buffers of fixed size: bounds are checked here. */
#include "memory.h"

#include "mem.h"
#include "shell.h"
#include "supervisor.h"

enum { MOST_READ = 24, MOST_WRITTEN = 25 };

static uint32_t size(const uint8_t internal_id) {
  (void)internal_id;
  return perch_memory_size();
}

static bool read(const uint8_t internal_id, const uint32_t address, const uint8_t length, uint8_t *buffer) {
  (void)internal_id;
  return length <= MOST_READ && perch_memory_read(&perch, address, length, buffer);
}

static bool write(const uint8_t internal_id, const uint32_t address, const uint8_t length,
                  const uint8_t *buffer) {
  (void)internal_id;
  return length <= MOST_WRITTEN &&
         perch_memory_write(&perch, address, length, buffer, supervisorIsFlying());
}

static const MemoryHandlerDef_t handler = {
    .type = MEM_TYPE_APP,
    .getSize = size,
    .read = read,
    .write = write,
};

void perch_register_memory(void) { memoryRegisterHandler(&handler); }
