/* The last 0.7 s around a trigger, as law and policy saw them: what the ground reads after a landing.
 *
 * Runs from arming on and stops 0.3 s after the approach has ended, until the next arming. */
#ifndef PERCH_RECORDER_H
#define PERCH_RECORDER_H

#include "controller.h"
#include "policy.h"

enum {
  PERCH_RECORD_PERIODS = 70,        /* of 10 ms */
  PERCH_RECORD_AFTER_MS = 300,      /* recorded after the approach has ended */
  PERCH_RECORD_SECOND_SAMPLE_MS = 4 /* after the first: two samples a period, of a law that runs every 2 ms */
};

/* What a step of the law had and gave: float32 as it had it. */
typedef struct {
  perch_estimate estimate;
  perch_quaternion own_attitude;
  float voltage;     /* filtered, V */
  float thrusts[4];  /* N */
} perch_law_sample;

typedef struct {
  perch_cues cues;
  float trigger_value, a_rot;
} perch_policy_sample;

/* 10 ms: an evaluation of the policy, the law of the same ms, and that of 4 ms later. */
typedef struct {
  perch_policy_sample policy;
  perch_law_sample law[2];
} perch_period;

typedef enum { PERCH_RECORD_OFF = 0, PERCH_RECORD_RUNS = 1, PERCH_RECORD_ENDS = 2 } perch_recorder_state;

/* Read by the ground as it lies here, little endian. */
typedef struct {
  uint32_t begun;     /* periods so far; number n is at n % 70, the newest is begun - 1 */
  uint32_t last_tick; /* of the newest period, ms */
  uint32_t stop_tick; /* when it stops, or has */
  uint16_t period_bytes;
  uint8_t periods;
  uint8_t state; /* a perch_recorder_state */
  perch_period period[PERCH_RECORD_PERIODS];
} perch_recorder;

/* Forget everything, and run. */
void perch_record_begin(perch_recorder *recorder);

/* The approach has ended: stop a while after `tick`. */
void perch_record_end(perch_recorder *recorder, uint32_t tick);

/* Whether a step of the law at `tick` is recorded. */
bool perch_is_recorded(const perch_recorder *recorder, uint32_t tick);

/* Take in a step of the law at `tick`, with the newest evaluation. */
void perch_record(perch_recorder *recorder, uint32_t tick, const perch_policy_sample *policy,
                  const perch_law_sample *law);

#endif
