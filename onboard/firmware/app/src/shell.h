/* The landing app on the Crazyflie's firmware: its one core, and what its parts know of each other.
 *
 * Tasks: the firmware's control loop calls controllerOutOfTree() a thousand times a second; parameter callbacks and
 * memory handlers come from tasks of low priority; so does appMain(). What they hand to the control loop goes
 * through the core's requests and flags alone. */
#ifndef PERCH_SHELL_H
#define PERCH_SHELL_H

#include <stdbool.h>
#include <stdint.h>

#include "core.h"
#include "stabilizer_types.h"

extern perch_core perch;

/* What the ground writes of its own; the addresses behind the parameters. */
typedef struct {
  uint16_t policy_length;
  uint32_t policy_crc;
  uint8_t policy_commit, policy_status, policy_arm;
  uint32_t policy_active_crc;
  uint8_t trajectory_arm;
  uint8_t go, abort;
  float ceiling_z, impact_x, impact_y, vx, vz, ax, az, tau0;
  uint32_t vehicle_crc;
  uint8_t version, engine;
  uint8_t own_law;     /* 1: our law flies what the planner asks, 0: the firmware's PID does */
  uint8_t motor_token; /* written by a host whose motor test runs */
  uint8_t rehearse; /* a perch_rehearsal */
} perch_parameters;

extern perch_parameters perch_ground;

/* Take over what a step of the core has done to the switches. */
void perch_answer_ground(uint8_t events);

/* Show the memory to the host; only before the firmware has listed its memories. */
void perch_register_memory(void);

/* Look whether the firmware is configured as the app needs it. */
void perch_check_configuration(void);

/* Whether it is. */
bool perch_is_configured(void);

/* Stop motors that a host has set and does not vouch for any more; ms until it must be looked at again. */
uint32_t perch_watch_bench_motors(void);

/* Milliseconds since the last external pose, or PERCH_NO_POSE; for the control loop. */
uint32_t perch_pose_age(uint32_t now_ms);

/* A setpoint of the firmware in the core's units and signs, at a tick of the system (ms). */
perch_setpoint perch_setpoint_from(const setpoint_t *setpoint, uint32_t now_ms);

/* Whether the supervisor has put level-out in the setpoint's place. */
bool perch_is_level_out(const setpoint_t *setpoint);

/* When the last flip was triggered, ms since boot: the clock of the host's log packets. */
uint32_t perch_trigger_ms(void);

#endif
