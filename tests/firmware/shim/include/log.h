/* Log variables, as parameters in param.h. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

typedef struct {
  const char *name;
  uint8_t type;
  void *address;
  bool by_function;
} shim_log;

void shim_add_logs(const char *group, const shim_log *first, int count);

enum { LOG_UINT8 = 1, LOG_UINT16 = 2, LOG_UINT32 = 3, LOG_FLOAT = 7 };

typedef uint32_t (*logAcquireUInt32)(uint32_t timestamp, void *data);
typedef struct {
  logAcquireUInt32 acquireUInt32;
  void *data;
} logByFunction_t;

#define LOG_GROUP_START(GROUP) static const shim_log shim_logs_##GROUP[] = {
#define LOG_ADD(TYPE, NAME, ADDRESS) {#NAME, TYPE, (void *)(ADDRESS), false},
#define LOG_ADD_BY_FUNCTION(TYPE, NAME, ADDRESS) {#NAME, TYPE, (void *)(ADDRESS), true},
#define LOG_GROUP_STOP(GROUP)                                                                       \
  };                                                                                                \
  __attribute__((constructor)) static void shim_register_logs_##GROUP(void) {                       \
    shim_add_logs(#GROUP, shim_logs_##GROUP, (int)(sizeof shim_logs_##GROUP / sizeof(shim_log)));   \
  }

typedef uint16_t logVarId_t;
static inline bool logVarIdIsValid(logVarId_t varId) { return varId != 0xffffu; }
logVarId_t logGetVarId(const char *group, const char *name);
unsigned int logGetUint(logVarId_t varid);
