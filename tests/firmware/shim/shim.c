#include "shim.h"

#include <string.h>

#include "app.h"
#include "commander.h"
#include "controller.h"
#include "controller_pid.h"
#include "mem.h"
#include "pm.h"
#include "static_mem.h"
#include "supervisor.h"
#include "tables.h"
#include "task.h"
#include "tasks.h"

extern perch_core perch;

static shim_world world = {.voltage = 4.0f, .estimator = 2};
static shim_asked asked;
static shim_task app_task, parameter_task, memory_task;
static MemoryHandlerDef_t memory;

static struct {
  uint32_t address;
  uint8_t length, bytes[255];
  bool done;
} packet;

shim_world *shim_the_world(void) { return &world; }
const shim_asked *shim_what_was_asked(void) { return &asked; }
const perch_outputs *shim_what_came_out(void) { return &perch.outputs; }

void shim_create_task(void (*function)(void *)) { shim_start(&app_task, function, NULL); }

void shim_boot(void) {
  appInit();
  controllerOutOfTreeInit();
}

void shim_choose_controller(void) { controllerOutOfTreeInit(); }

void shim_control(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors,
                  const state_t *state, stabilizerStep_t step) {
  controllerOutOfTree(control, setpoint, sensors, state, step);
}

static void run_callback(void *parameter) { ((const shim_parameter *)parameter)->callback(); }

bool shim_write(const char *name, const void *bytes, int size) {
  const shim_parameter *found = shim_find_parameter(name);
  if (!found || (found->type & PARAM_RONLY) || size != shim_parameter_size(found) || parameter_task.is_alive) {
    return false;
  }
  memcpy(found->address, bytes, (size_t)size);
  if (found->callback) {
    shim_start(&parameter_task, run_callback, (void *)(uintptr_t)found);
  }
  return true;
}

bool shim_parameter_task_waits(void) { return parameter_task.is_alive; }
void shim_go_on_with_parameters(void) { shim_go_on(&parameter_task); }

void shim_go_on_with_app(void) {
  if ((int32_t)(world.tick_ms - world.app_late_ms - app_task.wakes_at) >= 0) {
    shim_go_on(&app_task);
  }
}

void shim_interrupt_parameters(int place) { parameter_task.interrupted_in = place; }
void shim_interrupt_memory(int place) { memory_task.interrupted_in = place; }
void shim_interrupt_app(int place) { app_task.interrupted_in = place; }

bool shim_memory_read(uint32_t address, uint8_t length, uint8_t *buffer) {
  return memory.read(0, address, length, buffer);
}

bool shim_memory_write(uint32_t address, uint8_t length, const uint8_t *buffer) {
  return memory.write(0, address, length, buffer);
}

uint32_t shim_memory_size(void) { return memory.getSize(0); }

static void write_packet(void *argument) {
  (void)argument;
  packet.done = memory.write(0, packet.address, packet.length, packet.bytes);
}

void shim_begin_memory_write(uint32_t address, uint8_t length, const uint8_t *buffer) {
  packet.address = address;
  packet.length = length;
  memcpy(packet.bytes, buffer, length);
  shim_start(&memory_task, write_packet, NULL);
}

bool shim_memory_task_waits(void) { return memory_task.is_alive; }
void shim_go_on_with_memory(void) { shim_go_on(&memory_task); }
bool shim_memory_was_written(void) { return packet.done; }
const uint8_t *shim_live_policy(void) { return perch.live.bytes; }

/* What the app calls. */

uint32_t xTaskGetTickCount(void) { return world.tick_ms; }
float pmGetBatteryVoltage(void) { return world.voltage; }
bool supervisorIsFlying(void) { return world.flying; }
bool supervisorIsArmed(void) { return world.armed; }

bool supervisorRequestArming(bool doArm) {
  asked.disarmings += !doArm;
  world.armed = doArm;
  return true;
}

void memoryRegisterHandler(const MemoryHandlerDef_t *handlerDef) { memory = *handlerDef; }
void commanderRelaxPriority(void) { asked.priorities_relaxed++; }

int crtpCommanderHighLevelStop(void) {
  asked.planner_stops++;
  return 0;
}

int crtpCommanderHighLevelGoTo2(float x, float y, float z, float yaw, float duration_s, bool relative,
                                bool linear) {
  (void)yaw, (void)duration_s, (void)relative, (void)linear;
  asked.planner_goals++;
  asked.goal[0] = x;
  asked.goal[1] = y;
  asked.goal[2] = z;
  return 0;
}

void controllerPidInit(void) {}
bool controllerPidTest(void) { return true; }

void controllerPid(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors,
                   const state_t *state, const stabilizerStep_t stabilizerStep) {
  (void)setpoint, (void)sensors, (void)state, (void)stabilizerStep;
  asked.pid_steps++;
  control->controlMode = controlModeLegacy;
}
