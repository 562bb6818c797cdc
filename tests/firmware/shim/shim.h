/* A firmware in a test's hands: what the landing app asks of the Crazyflie's firmware, and the strings that move it.
 *
 * Written from the names and the order of calls alone; no line of the firmware is in it. A task that delays itself
 * stands still until the test lets it go on, so that nothing depends on the machine's clock. */
#ifndef PERCH_SHIM_H
#define PERCH_SHIM_H

#include "core.h"
#include "crtp_commander_high_level.h"
#include "stabilizer_types.h"

/* What the rest of the firmware is like, set by the test. */
typedef struct {
  uint32_t tick_ms;
  float voltage;
  bool flying, armed;
  uint16_t pose_tick; /* locSrvZ.tick */
  uint16_t motors[4]; /* motor.m1 to m4 */
  uint32_t app_late_ms; /* that the app's slow task waits for others after each of its delays */
  /* Parameters of the firmware. */
  uint8_t motor_override; /* motorPowerSet.enable */
  uint8_t estimator;      /* stabilizer.estimator */
  uint32_t idle_thrust;   /* powerDist.idleThrust */
} shim_world;

/* What the app has asked of it. */
typedef struct {
  uint32_t planner_stops, planner_goals, priorities_relaxed, pid_steps, disarmings;
  float goal[3];
} shim_asked;

shim_world *shim_the_world(void);
const shim_asked *shim_what_was_asked(void);
const perch_outputs *shim_what_came_out(void);

/* Start the app: appInit, and its slow task until it first delays itself. */
void shim_boot(void);

/* Somebody has chosen this controller. */
void shim_choose_controller(void);

/* One ms of the control loop. */
void shim_control(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors,
                  const state_t *state, stabilizerStep_t step);

/* Write a parameter as a packet does, and run its callback until it ends or waits. False: not there, read-only, of
 * another size, or the parameter task still waits in another callback. */
bool shim_write(const char *name, const void *bytes, int size);

/* Read a parameter or log variable; its size in bytes, 0: not there. */
int shim_read_parameter(const char *name, void *bytes);
int shim_read_log(const char *name, void *bytes);

/* Names and types, one after the other; NULL after the last. */
const char *shim_parameter_name(int number, uint8_t *type);
const char *shim_log_name(int number, uint8_t *type);

/* Let the parameter task go on after a delay, and the app's slow task if its delay is over. */
bool shim_parameter_task_waits(void);
void shim_go_on_with_parameters(void);
void shim_go_on_with_app(void);

/* Interrupt the parameter task, that of the memory, or the app's slow task at the so manieth place from now on where it
 * can be (tasks.c); 0: never. It stands still until it shall go on. */
void shim_interrupt_parameters(int place);
void shim_interrupt_memory(int place);
void shim_interrupt_app(int place);

bool shim_memory_read(uint32_t address, uint8_t length, uint8_t *buffer);
bool shim_memory_write(uint32_t address, uint8_t length, const uint8_t *buffer);
uint32_t shim_memory_size(void);

/* The same write by the memory's task; whether it is still at it, and what came of it. */
void shim_begin_memory_write(uint32_t address, uint8_t length, const uint8_t *buffer);
bool shim_memory_task_waits(void);
void shim_go_on_with_memory(void);
bool shim_memory_was_written(void);

/* What the control loop takes for its policy. */
const uint8_t *shim_live_policy(void);

#endif
