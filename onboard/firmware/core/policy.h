/* The landing policy: its bundle (docs/policy_bundle.md), when to flip, and how hard. */
#ifndef PERCH_POLICY_H
#define PERCH_POLICY_H

#include <stddef.h>

#include "interface.h"
#include "vector.h"

/* A bundle in memory; its numbers are used where they lie. */
typedef union {
  uint8_t bytes[PERCH_MAX_BUNDLE];
  uint16_t halves[PERCH_MAX_BUNDLE / 2];
  uint32_t words[PERCH_MAX_BUNDLE / 4];
  float numbers[PERCH_MAX_BUNDLE / 4];
} perch_bank;

/* A checked bundle. Whatever has a `bank` may be evaluated. */
typedef struct {
  const perch_bank *bank;
  uint32_t crc; /* of all bytes: the name of the policy */
  uint16_t vectors;
  uint8_t layers;
  uint8_t sizes[1 + PERCH_MAX_LAYERS]; /* the input's first */
} perch_policy;

/* tau [s], theta_x [rad/s], d_ceil [m]. */
typedef struct {
  float tau, theta_x, d_ceil;
} perch_cues;

/* Check the first `length` bytes of `bank`; ACTIVE: `policy` is made, anything else: it is left alone. */
perch_policy_status perch_parse_bundle(const perch_bank *bank, size_t length, perch_policy *policy);

/* s. Below it the policy cannot fire. */
float perch_tau_min(const perch_policy *policy);

/* Cues of a vehicle at height `z` (m) with `vx`, `vz` (m/s), world frame: onboard/cues.py. */
perch_cues perch_optical_flow_cues(float z, float vx, float vz, float ceiling_z);

/* Value of the trigger: the flip starts when it is >= 0; NaN for a cue of NaN. */
float perch_trigger_value(const perch_policy *policy, const perch_cues *cues);

/* Moment of the flip (N m about b_y, negative nose up), within the policy's range; never NaN. */
float perch_action_moment(const perch_policy *policy, const perch_cues *cues);

/* The cues as both stages take them. */
void perch_standardise(const perch_policy *policy, const perch_cues *cues, float standardised[3]);

/* Where the numbers of the bundle are. */
const float *perch_dual_coefficients(const perch_policy *policy);
const float *perch_support_vectors(const perch_policy *policy);
const float *perch_layer_numbers(const perch_policy *policy);

/* Places of the numbers of the header, in 4 bytes. */
enum {
  PERCH_AT_GAMMA = 6,
  PERCH_AT_INTERCEPT = 7,
  PERCH_AT_TAU_MIN = 8,
  PERCH_AT_TAU_MAX = 9,
  PERCH_AT_A_ROT_MIN = 10,
  PERCH_AT_A_ROT_MAX = 11,
  PERCH_AT_MEAN = 12,
  PERCH_AT_STD = 15,
  PERCH_AT_BODY = 22,
};

#endif
