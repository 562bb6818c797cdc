/* The landing state machine: what goes in, what comes out, what it remembers (onboard/landing).
 *
 *   IDLE --arm--> TRAJECTORY_ARMED --go--> APPROACH --trigger--> FLIP --b3.z <= 0--> CUT
 *                                             |
 *                                             +--missed, abort, bad pose--> BRAKE --> HOLD --> IDLE
 *
 * Default deny: what is not known is not allowed, and a NaN never starts anything. */
#ifndef PERCH_LANDING_H
#define PERCH_LANDING_H

#include "approach.h"
#include "interface.h"
#include "policy.h"
#include "vehicle.h"

/* Age of the last pose where there was none. */
#define PERCH_NO_POSE UINT32_MAX

/* What the drone has to do. */
typedef enum {
  PERCH_PASS = 0,     /* whoever flew before goes on */
  PERCH_SETPOINT = 1, /* track `motion`, heading 0 */
  PERCH_LEVEL = 2,    /* hold the body level with `collective` */
  PERCH_THRUSTS = 3,  /* give the motors `thrusts`, past controller and mixer */
  PERCH_OFF = 4,      /* stop the motors */
} perch_output_mode;

/* Estimate (m, m/s, world; body to world), gyro (rad/s, body), ages and times. */
typedef struct {
  uint32_t tick;     /* ms, wraps */
  uint32_t pose_age; /* ms since the last external pose */
  float dt;          /* s since the last step */
  perch_vector position, velocity;
  perch_quaternion quaternion;
  perch_vector gyro;
  perch_cues cues; /* of the last evaluation */
  float trigger_value, a_rot;
  float policy_tau_min; /* s; NaN without a policy */
  bool evaluated;       /* in this very step */
  bool policy_armed, trajectory_armed, go, abort;
  bool flying;
} perch_landing_inputs;

/* The sample that triggered the last flip. `count` is written last: who sees the new one finds the rest. */
typedef struct {
  uint32_t tick;
  perch_cues cues;
  float trigger_value, a_rot;
  perch_vector velocity;
  float z, pitch;
  uint32_t count;
} perch_snapshot;

typedef struct {
  uint8_t state, trajectory_status, reason;
  bool arm_seen, go_seen, attitude_known;
  perch_quaternion attitude; /* own: turned by the gyro, pulled slowly to the estimate outside the flip */
  uint32_t start_tick, flip_tick, usable_tick, hold_tick;
  perch_vector hold_position, hold_velocity;
  perch_snapshot snapshot;
} perch_landing_memory;

typedef struct {
  perch_output_mode mode;
  perch_motion motion;
  float collective;  /* N */
  float thrusts[4];  /* N, M1 to M4 */
} perch_landing_output;

/* One step of the machine, at 500 Hz. The plan must not change while the trajectory is armed. */
perch_landing_output perch_landing_step(perch_landing_memory *memory, const perch_landing_inputs *in,
                                        const perch_plan *plan, const perch_vehicle *vehicle);

/* Turn the own attitude by the gyro, and outside the flip a little towards the estimate. */
void perch_propagate_attitude(perch_landing_memory *memory, const perch_landing_inputs *in);

/* Rise (m) until standstill from a climb of `speed` (m/s) with an upward `acceleration` (m/s2) whose thrust
 * falls with the time constant `motor_lag` (s). */
float perch_stopping_distance(float speed, float acceleration, float motor_lag);

/* Where a hold after a brake is to be now. */
perch_motion perch_hold_motion(const perch_landing_memory *memory, uint32_t tick, const perch_plan *plan,
                               const perch_vehicle *vehicle);

/* Whether attitude, position and velocity are numbers. */
bool perch_estimate_is_finite(const perch_landing_inputs *in);

/* Whether an external pose arrived not long ago. */
bool perch_has_pose(const perch_landing_inputs *in, const perch_vehicle *vehicle);

/* Whether to brake and hold by the estimate: possible, and in a blind hold near its setpoint. */
bool perch_estimate_is_usable(const perch_landing_memory *memory, const perch_landing_inputs *in,
                              const perch_plan *plan, const perch_vehicle *vehicle);

#endif
