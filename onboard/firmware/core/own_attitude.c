/* The machine's own attitude: one bad pose in the flip cannot move the cut (onboard/landing/attitude.py). */
#include "landing.h"
#include "rotation.h"

#define GAIN 5.0f       /* 1/s: how fast it follows the estimate */
#define RATE 0.5f       /* rad/s: fastest correction while flying */
#define RATE_IDLE 20.0f /* rad/s: while nothing depends on it */

static bool is_attitude(const perch_quaternion *q) { return isfinite(q->x + q->y + q->z + q->w); }

static perch_quaternion pulled_towards(const perch_quaternion *attitude, const perch_quaternion *estimate,
                                       float most, float dt) {
  const perch_quaternion inverse = {-attitude->x, -attitude->y, -attitude->z, attitude->w};
  const perch_quaternion error = perch_multiply(&inverse, estimate);
  const float sign = error.w >= 0.0f ? 2.0f : -2.0f;
  const perch_vector left = {sign * error.x, sign * error.y, sign * error.z};
  const float size = perch_norm(&left);
  float share = perch_min(GAIN * dt, 1.0f);
  if (share * size > most) {
    share = most / size;
  }
  const perch_vector turned = {share * left.x, share * left.y, share * left.z};
  const perch_quaternion turn = perch_from_rotation_vector(&turned);
  const perch_quaternion product = perch_multiply(attitude, &turn);
  return perch_normalise(&product);
}

void perch_propagate_attitude(perch_landing_memory *memory, const perch_landing_inputs *in) {
  const perch_quaternion estimate = perch_normalise(&in->quaternion);
  const bool usable = is_attitude(&estimate);
  const bool in_step = in->dt > 0.0f && in->dt < 0.1f;
  perch_quaternion attitude = memory->attitude;
  if (!memory->attitude_known) {
    if (!usable) {
      return;
    }
    memory->attitude_known = true;
    attitude = estimate;
  } else if (perch_is_finite(&in->gyro) && in_step) {
    const perch_quaternion turned = perch_integrate(&attitude, &in->gyro, in->dt);
    if (is_attitude(&turned)) { /* rates can be finite whose sum of squares is not */
      attitude = turned;
    }
  }
  if (usable && memory->state != PERCH_FLIP && in_step) {
    const bool loose =
        memory->state == PERCH_IDLE || memory->state == PERCH_CUT || memory->state == PERCH_FAULT;
    attitude = pulled_towards(&attitude, &estimate, (loose ? RATE_IDLE : RATE) * in->dt, in->dt);
  }
  memory->attitude = attitude;
}
