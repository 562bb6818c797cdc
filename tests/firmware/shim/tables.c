/* Parameters and log variables: of the app, and the few of the firmware that it looks at. */
#include <string.h>

#include "log.h"
#include "param.h"
#include "shim.h"
#include "tables.h"

enum { MOST = 128 };

typedef struct {
  char name[32];
  shim_parameter parameter;
} parameter_row;

typedef struct {
  char name[32];
  shim_log log;
} log_row;

static parameter_row parameters[MOST];
static log_row logs[MOST];
static int parameter_count, log_count;

static void full_name(char *to, const char *group, const char *name) {
  strcpy(to, group);
  strcat(to, ".");
  strcat(to, name);
}

void shim_add_parameters(const char *group, const shim_parameter *first, int count) {
  for (int i = 0; i < count; i++) {
    full_name(parameters[parameter_count].name, group, first[i].name);
    parameters[parameter_count++].parameter = first[i];
  }
}

void shim_add_logs(const char *group, const shim_log *first, int count) {
  for (int i = 0; i < count; i++) {
    full_name(logs[log_count].name, group, first[i].name);
    logs[log_count++].log = first[i];
  }
}

__attribute__((constructor)) static void firmware_tables(void) {
  shim_world *world = shim_the_world();
  const shim_parameter override = {"enable", PARAM_UINT8, &world->motor_override, 0};
  const shim_parameter estimator = {"estimator", PARAM_UINT8, &world->estimator, 0};
  const shim_parameter idle = {"idleThrust", PARAM_UINT32, &world->idle_thrust, 0};
  const shim_log pose = {"tick", LOG_UINT16, &world->pose_tick, false};
  const shim_log motors[] = {{"m1", LOG_UINT16, &world->motors[0], false},
                             {"m2", LOG_UINT16, &world->motors[1], false},
                             {"m3", LOG_UINT16, &world->motors[2], false},
                             {"m4", LOG_UINT16, &world->motors[3], false}};
  shim_add_parameters("motorPowerSet", &override, 1);
  shim_add_parameters("stabilizer", &estimator, 1);
  shim_add_parameters("powerDist", &idle, 1);
  shim_add_logs("locSrvZ", &pose, 1);
  shim_add_logs("motor", motors, 4);
}

const shim_parameter *shim_find_parameter(const char *name) {
  for (int i = 0; i < parameter_count; i++) {
    if (strcmp(parameters[i].name, name) == 0) {
      return &parameters[i].parameter;
    }
  }
  return 0;
}

static int parameter_size(uint8_t type) { return 1 << (type & 3); }

static int log_size(uint8_t type) {
  return type == LOG_UINT8 ? 1 : type == LOG_UINT16 ? 2 : 4;
}

int shim_parameter_size(const shim_parameter *parameter) { return parameter_size(parameter->type); }

int shim_read_parameter(const char *name, void *bytes) {
  const shim_parameter *found = shim_find_parameter(name);
  if (!found) {
    return 0;
  }
  memcpy(bytes, found->address, (size_t)parameter_size(found->type));
  return parameter_size(found->type);
}

int shim_read_log(const char *name, void *bytes) {
  for (int i = 0; i < log_count; i++) {
    const shim_log *log = &logs[i].log;
    if (strcmp(logs[i].name, name) == 0 && log->by_function) {
      const logByFunction_t *asked = log->address;
      const uint32_t value = asked->acquireUInt32(shim_the_world()->tick_ms, asked->data);
      memcpy(bytes, &value, sizeof value);
      return 4;
    }
    if (strcmp(logs[i].name, name) == 0) {
      memcpy(bytes, log->address, (size_t)log_size(log->type));
      return log_size(log->type);
    }
  }
  return 0;
}

const char *shim_parameter_name(int number, uint8_t *type) {
  if (number >= parameter_count) {
    return 0;
  }
  *type = parameters[number].parameter.type;
  return parameters[number].name;
}

const char *shim_log_name(int number, uint8_t *type) {
  if (number >= log_count) {
    return 0;
  }
  *type = logs[number].log.type;
  return logs[number].name;
}

paramVarId_t paramGetVarId(const char *group, const char *name) {
  char wanted[64];
  full_name(wanted, group, name);
  for (int i = 0; i < parameter_count; i++) {
    if (strcmp(parameters[i].name, wanted) == 0) {
      return (paramVarId_t){(uint16_t)i};
    }
  }
  return (paramVarId_t){0xffffu};
}

unsigned int paramGetUint(paramVarId_t varid) {
  unsigned int value = 0;
  const shim_parameter *parameter = &parameters[varid.id].parameter;
  memcpy(&value, parameter->address, (size_t)parameter_size(parameter->type));
  return value;
}

void paramSetInt(paramVarId_t varid, int valuei) {
  const shim_parameter *parameter = &parameters[varid.id].parameter;
  memcpy(parameter->address, &valuei, (size_t)parameter_size(parameter->type));
}

logVarId_t logGetVarId(const char *group, const char *name) {
  char wanted[64];
  full_name(wanted, group, name);
  for (int i = 0; i < log_count; i++) {
    if (strcmp(logs[i].name, wanted) == 0) {
      return (logVarId_t)i;
    }
  }
  return 0xffffu;
}

unsigned int logGetUint(logVarId_t varid) {
  unsigned int value = 0;
  memcpy(&value, logs[varid].log.address, (size_t)log_size(logs[varid].log.type));
  return value;
}
