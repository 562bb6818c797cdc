#pragma once
#include <stdbool.h>
#include <stdint.h>
typedef enum { MEM_TYPE_APP = 0x18 } MemoryType_t;
typedef struct {
  MemoryType_t type;
  uint32_t (*getSize)(const uint8_t internal_id);
  bool (*read)(const uint8_t internal_id, const uint32_t memAddr, const uint8_t readLen, uint8_t *buffer);
  bool (*write)(const uint8_t internal_id, const uint32_t memAddr, const uint8_t writeLen, const uint8_t *buffer);
} MemoryHandlerDef_t;
void memoryRegisterHandler(const MemoryHandlerDef_t *handlerDef);
