/* When to flip: a one-class support vector machine (onboard/policy/trigger.py). */
#include "policy.h"

void perch_standardise(const perch_policy *policy, const perch_cues *cues, float standardised[3]) {
  const float *mean = policy->bank->numbers + PERCH_AT_MEAN;
  const float *std = policy->bank->numbers + PERCH_AT_STD;
  standardised[0] = (cues->tau - mean[0]) / std[0];
  standardised[1] = (cues->theta_x - mean[1]) / std[1];
  standardised[2] = (cues->d_ceil - mean[2]) / std[2];
}

float perch_trigger_value(const perch_policy *policy, const perch_cues *cues) {
  const float gamma = policy->bank->numbers[PERCH_AT_GAMMA];
  const float *alpha = perch_dual_coefficients(policy);
  const float *vector = perch_support_vectors(policy);
  float x[3];
  float total = 0.0f;
  perch_standardise(policy, cues, x);
  for (uint32_t i = 0; i < policy->vectors; i++, vector += 3) {
    const float e0 = x[0] - vector[0];
    const float e1 = x[1] - vector[1];
    const float e2 = x[2] - vector[2];
    total += alpha[i] * expf(-gamma * (e0 * e0 + e1 * e1 + e2 * e2));
  }
  return total + policy->bank->numbers[PERCH_AT_INTERCEPT];
}
