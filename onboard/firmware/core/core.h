/* All that the landing app computes: one call of perch_step a ms.
 *
 * Two tasks meet here. The control loop calls perch_step alone. A task of lower priority posts requests and flags,
 * stages and commits policies, and reads the report; everything that it writes is taken over by the next step. */
#ifndef PERCH_CORE_H
#define PERCH_CORE_H

#include "flight_model.h"
#include "follower.h"
#include "landing.h"
#include "recorder.h"

enum { PERCH_AVERAGED_STEPS = 5 }; /* of the law, so 10 ms */

/* What the control loop has in this ms. */
typedef struct {
  uint32_t tick;     /* ms since boot */
  uint32_t pose_age; /* ms, or PERCH_NO_POSE */
  perch_estimate estimate;
  float voltage; /* of the battery, as measured, V */
  bool flying;   /* says the supervisor */
  bool levelling; /* the supervisor has replaced the setpoint */
  bool thrust_seen; /* a motor has a thrust, whoever gave it */
  perch_setpoint setpoint; /* after the supervisor's say */
} perch_inputs;

/* What happened in a step, bit by bit. */
enum {
  PERCH_GO_TAKEN = 1,     /* the flag `go` has counted */
  PERCH_ABORT_TAKEN = 2,  /* the flag `abort` has counted */
  PERCH_REFUSED = 4,      /* arming: the switch is off again */
  PERCH_HANDED_OVER = 8,  /* the planner shall stay where the drone is */
  PERCH_CUT_MOTORS = 16,  /* the planner's plan shall be dropped */
  PERCH_REHEARSAL_ENDED = 32, /* all switches are off again */
};

/* What the drone shall do, and what there is to say about it. */
typedef struct {
  float thrusts[4]; /* N, M1 to M4 */
  float duties[4];  /* share of the battery voltage, 0..1 */
  uint16_t mean_ratios[4]; /* duties of the last 10 ms, 0..65535: what a log of 100 Hz can tell without aliases */
  perch_wrench wrench; /* as the mixer got it */
  perch_motion motion;     /* while `mode` is SETPOINT */
  uint8_t mode;            /* a perch_output_mode */
  uint8_t events;          /* of this ms */
  uint8_t state, reason;
  uint8_t trajectory_status; /* NONE while a request waits */
  bool trajectory_armed, policy_armed, rehearses;
  perch_policy_sample policy; /* of the last evaluation */
  float filtered_voltage;     /* V */
} perch_outputs;

/* A write of perch.trjArm. */
typedef struct {
  bool armed;
  perch_plan plan;
} perch_request;

typedef struct {
  const perch_vehicle *vehicle;
  perch_landing_memory landing;
  perch_plan plan;
  perch_follower follower;
  perch_vector lagged; /* memory of the moments' lead */
  uint16_t recent_ratios[PERCH_AVERAGED_STEPS][4];
  perch_outputs outputs;
  perch_flight_model model; /* of a rehearsal on it */

  perch_request request;
  volatile uint32_t posted, consumed;
  volatile bool policy_armed, go, abort;
  bool trajectory_armed;
  volatile uint8_t rehearses; /* a perch_rehearsal */
  uint8_t rehearsed;          /* in the step before */
  bool holds_on;  /* handed over, and the planner has not spoken yet */
  float idle_ceiling_z;

  volatile bool policy_is_live;
  volatile bool stages, commits; /* a task writes to the staged bundle; one takes it over */
  perch_policy policy;
  perch_bank staged, live;
  perch_recorder recorder;
} perch_core;

/* Start anew: no policy, nothing armed. `vehicle` must outlive the core. */
void perch_boot(perch_core *core, const perch_vehicle *vehicle);

/* One ms. The outputs are also in `core->outputs`. */
void perch_step(perch_core *core, const perch_inputs *in);

/* The control loop has not stepped for a while: what went on is not known. To be called by it, before its step. */
void perch_resume(perch_core *core);

/* Another law flew this step: its errors of position are not ours to integrate. */
void perch_give_way(perch_core *core);

/* Post a request; gives its number. */
uint32_t perch_post(perch_core *core, bool armed, const perch_approach *approach);

/* Whether the control loop has taken request `number`. */
bool perch_is_consumed(const perch_core *core, uint32_t number);

/* Arm the policy, which needs one; says whether it is armed now. */
bool perch_arm_policy(perch_core *core, bool on);

/* Flags: they count once. */
void perch_ask_go(perch_core *core, bool on);
void perch_ask_abort(perch_core *core, bool on);

/* Begin a rehearsal (rehearsal.h), or end it: a perch_rehearsal. `at_rest`: the supervisor is neither armed nor
 * flying, and no motor has a thrust. Says which is on now. */
uint8_t perch_rehearse(perch_core *core, uint8_t wanted, bool at_rest);

/* Height (m) of the ceiling for the cues while nothing is armed. */
void perch_set_ceiling(perch_core *core, float ceiling_z);

/* Make the first `length` staged bytes the live policy, if they are one and their CRC is `crc`. For a task of
 * low priority; refused while `flying`, and where another task is just writing to them. A refusal keeps the policy
 * that is live. */
perch_policy_status perch_commit(perch_core *core, uint32_t length, uint32_t crc, bool flying);

/* CRC of the live policy; 0 without one. */
uint32_t perch_live_crc(const perch_core *core);

#endif
