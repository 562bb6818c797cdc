/* Parameters as a list that the test can ask for: groups register themselves when the library is loaded. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

typedef struct {
  const char *name;
  uint8_t type;
  void *address;
  void (*callback)(void);
} shim_parameter;

void shim_add_parameters(const char *group, const shim_parameter *first, int count);

enum { PARAM_UINT8 = 0x08, PARAM_UINT16 = 0x09, PARAM_UINT32 = 0x0A, PARAM_FLOAT = 0x06, PARAM_RONLY = 0x40 };

#define PARAM_GROUP_START(GROUP) static const shim_parameter shim_parameters_##GROUP[] = {
#define PARAM_ADD(TYPE, NAME, ADDRESS) {#NAME, (uint8_t)(TYPE), (void *)(ADDRESS), 0},
#define PARAM_ADD_WITH_CALLBACK(TYPE, NAME, ADDRESS, CALLBACK) {#NAME, (uint8_t)(TYPE), (void *)(ADDRESS), CALLBACK},
#define PARAM_GROUP_STOP(GROUP)                                                                     \
  };                                                                                                \
  __attribute__((constructor)) static void shim_register_parameters_##GROUP(void) {                 \
    shim_add_parameters(#GROUP, shim_parameters_##GROUP,                                            \
                        (int)(sizeof shim_parameters_##GROUP / sizeof(shim_parameter)));            \
  }

typedef struct { uint16_t id; } paramVarId_t;
#define PARAM_VARID_IS_VALID(VARID) ((VARID).id != 0xffffu)
paramVarId_t paramGetVarId(const char *group, const char *name);
unsigned int paramGetUint(paramVarId_t varid);
void paramSetInt(paramVarId_t varid, int valuei);
