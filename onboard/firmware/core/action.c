/* How hard to flip: a feed-forward network with ELU between its layers (onboard/policy/action.py). */
#include "policy.h"

/* One layer; gives where the next one's numbers begin. */
static const float *run_layer(const float *numbers, uint32_t inputs, uint32_t outputs, bool is_last,
                              const float *in, float *out) {
  const float *bias = numbers + outputs * inputs;
  for (uint32_t row = 0; row < outputs; row++) {
    float total = bias[row];
    for (uint32_t column = 0; column < inputs; column++) {
      total += numbers[row * inputs + column] * in[column];
    }
    out[row] = !is_last && total < 0.0f ? expm1f(total) : total;
  }
  return bias + outputs;
}

float perch_action_moment(const perch_policy *policy, const perch_cues *cues) {
  float first[PERCH_MAX_WIDTH], second[PERCH_MAX_WIDTH];
  float *in = first, *out = second;
  const float *numbers = perch_layer_numbers(policy);
  perch_standardise(policy, cues, in);
  for (uint32_t layer = 0; layer < policy->layers; layer++) {
    const bool is_last = layer + 1u == policy->layers;
    numbers = run_layer(numbers, policy->sizes[layer], policy->sizes[layer + 1], is_last, in, out);
    float *swapped = in;
    in = out;
    out = swapped;
  }
  const float least = policy->bank->numbers[PERCH_AT_A_ROT_MIN];
  const float most = policy->bank->numbers[PERCH_AT_A_ROT_MAX];
  if (!(in[0] >= least)) { /* also for NaN: a flip command is never NaN */
    return least;
  }
  return in[0] > most ? most : in[0];
}
