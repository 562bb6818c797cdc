#include "approach.h"

perch_plan perch_plan_approach(const perch_approach *a) {
  if (!(a->ax > 0.0f && a->az > 0.0f)) {
    return (perch_plan){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
  }
  perch_plan plan = {
      .y0 = a->impact_y, .vx = a->vx, .vz = a->vz, .ax = a->ax, .az = a->az, .tau0 = a->tau0,
      .impact_x = a->impact_x, .ceiling_z = a->ceiling_z,
  };
  plan.t_x = a->vx / a->ax;
  plan.t_z = a->vz / a->az;
  plan.z0 = a->ceiling_z - a->tau0 * a->vz - 0.5f * a->az * plan.t_z * plan.t_z;
  plan.x0 = a->impact_x - (a->vx * (plan.t_x + plan.t_z) - 0.5f * a->ax * plan.t_x * plan.t_x) - a->tau0 * a->vx;
  return plan;
}

bool perch_approach_is_sound(const perch_plan *p, float start_z_min) {
  return p->vx >= 0.0f && p->vx < 10.0f && p->vz >= 0.05f && p->vz < 10.0f && p->ax >= 0.05f && p->ax < 20.0f &&
         p->az >= 0.05f && p->az < 20.0f && p->tau0 >= 0.05f && p->tau0 < 5.0f && isfinite(p->x0) &&
         isfinite(p->y0) && start_z_min <= p->z0 && p->z0 < p->ceiling_z && p->ceiling_z < 100.0f;
}

/* Means over `half_width` s to both sides of a motion that begins at t = 0 and accelerates for ever. */
typedef struct {
  float distance, velocity, acceleration, jerk;
} ramp;

static ramp mean_of_ramp(float t, float half_width, float acceleration) {
  const float end = t + half_width, width = 2.0f * half_width;
  if (end <= 0.0f) {
    return (ramp){0.0f, 0.0f, 0.0f, 0.0f};
  }
  if (t <= half_width) { /* it begins within the width */
    return (ramp){acceleration * end * end * end / (6.0f * width), acceleration * end * end / (2.0f * width),
                  acceleration * end / width, acceleration / width};
  }
  return (ramp){acceleration * (0.5f * t * t + half_width * half_width / 6.0f), acceleration * t, acceleration,
                0.0f};
}

/* The same of one that accelerates for `duration` s. float32 loses less in this difference than in one of
 * integrals over the width. */
static ramp mean_of_speed_up(float t, float duration, float half_width, float acceleration) {
  const ramp begun = mean_of_ramp(t, half_width, acceleration);
  const ramp ended = mean_of_ramp(t - duration, half_width, acceleration);
  return (ramp){begun.distance - ended.distance, begun.velocity - ended.velocity,
                begun.acceleration - ended.acceleration, begun.jerk - ended.jerk};
}

perch_motion perch_smooth_approach(const perch_plan *plan, float t, float half_width, float *jerk_z) {
  const ramp x = mean_of_speed_up(t, plan->t_x, half_width, plan->ax);
  const ramp z = mean_of_speed_up(t - plan->t_x, plan->t_z, half_width, plan->az);
  *jerk_z = z.jerk;
  return (perch_motion){
      .position = {plan->x0 + x.distance, plan->y0, plan->z0 + z.distance},
      .velocity = {x.velocity, 0.0f, z.velocity},
      .acceleration = {x.acceleration, 0.0f, z.acceleration},
  };
}
