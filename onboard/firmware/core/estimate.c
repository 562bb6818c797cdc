/* Whether the drone's own estimate is fit to fly by (onboard/landing/estimate.py). */
#include "landing.h"

bool perch_estimate_is_finite(const perch_landing_inputs *in) {
  const perch_quaternion *q = &in->quaternion;
  return isfinite(q->x + q->y + q->z + q->w) && perch_is_finite(&in->position) && perch_is_finite(&in->velocity);
}

bool perch_has_pose(const perch_landing_inputs *in, const perch_vehicle *vehicle) {
  return in->pose_age != PERCH_NO_POSE && perch_seconds(in->pose_age) <= vehicle->limit_pose_age_limit;
}

bool perch_estimate_is_usable(const perch_landing_memory *memory, const perch_landing_inputs *in,
                              const perch_plan *plan, const perch_vehicle *vehicle) {
  if (!(perch_estimate_is_finite(in) && perch_is_finite(&in->gyro))) {
    return false;
  }
  if (!(perch_norm(&in->velocity) <= vehicle->limit_speed_limit)) {
    return false;
  }
  if (memory->state != PERCH_HOLD || perch_has_pose(in, vehicle)) {
    return true;
  }
  const perch_motion goal = perch_hold_motion(memory, in->tick, plan, vehicle);
  return perch_distance(&in->position, &goal.position) <= vehicle->limit_hold_distance;
}
