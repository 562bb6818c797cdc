/* Getting away from the ceiling: how far a climbing vehicle still rises, and where it goes then
 * (onboard/landing/braking.py). */
#include "landing.h"

enum { NEWTON_STEPS = 20 };

float perch_stopping_distance(float speed, float acceleration, float motor_lag) {
  if (!(speed > 0.0f)) {
    return 0.0f;
  }
  const float push = (PERCH_GRAVITY + acceleration) * motor_lag;
  /* v(t) is concave: from a time after the standstill Newton's method comes down to it without passing. */
  float t = (speed + push) / PERCH_GRAVITY;
  for (int i = 0; i < NEWTON_STEPS; i++) {
    const float decay = expf(-t / motor_lag);
    const float v = speed + push * (1.0f - decay) - PERCH_GRAVITY * t;
    const float slope = push / motor_lag * decay - PERCH_GRAVITY;
    if (slope >= 0.0f) {
      break;
    }
    const float step = v / slope;
    t -= step;
    if (fabsf(step) < 1e-6f) {
      break;
    }
  }
  const float decay = expf(-t / motor_lag);
  return speed * t + push * (t - motor_lag * (1.0f - decay)) - 0.5f * PERCH_GRAVITY * t * t;
}

/* Stop sideways with the hold's acceleration. */
static void stop_sideways(perch_motion *motion, const perch_vector *p, const perch_vector *v, float t, float a) {
  const float speed = sqrtf(v->x * v->x + v->y * v->y);
  const float s = perch_min(t, speed / a);
  const float slowed = speed > 1e-6f ? 1.0f - a * s / speed : 0.0f;
  const float travel = s * (1.0f + slowed) / 2.0f;
  const float pull = t < speed / a && speed > 1e-6f ? -a / speed : 0.0f;
  motion->position.x = p->x + v->x * travel;
  motion->position.y = p->y + v->y * travel;
  motion->velocity.x = v->x * slowed;
  motion->velocity.y = v->y * slowed;
  motion->acceleration.x = v->x * pull;
  motion->acceleration.y = v->y * pull;
}

perch_motion perch_hold_motion(const perch_landing_memory *memory, uint32_t tick, const perch_plan *plan,
                               const perch_vehicle *vehicle) {
  const perch_vector *p = &memory->hold_position, *v = &memory->hold_velocity;
  const float t = perch_seconds(tick - memory->hold_tick);
  const float a = vehicle->limit_hold_acceleration;
  const float lowest = plan->ceiling_z - vehicle->limit_hold_clearance;
  perch_motion motion = {0};
  stop_sideways(&motion, p, v, t, a);
  if (p->z > lowest) { /* sink to the clearance below the ceiling */
    motion.position.z = perch_max(lowest, p->z - vehicle->limit_descent_speed * t);
    motion.velocity.z = motion.position.z > lowest ? -vehicle->limit_descent_speed : 0.0f;
    return motion;
  }
  const float stopped = fabsf(v->z) / a;
  const float s = perch_min(t, stopped);
  const float sign = v->z >= 0.0f ? 1.0f : -1.0f;
  motion.position.z = p->z + v->z * s - 0.5f * sign * a * s * s;
  motion.velocity.z = v->z - sign * a * s;
  motion.acceleration.z = t < stopped ? -sign * a : 0.0f;
  return motion;
}
