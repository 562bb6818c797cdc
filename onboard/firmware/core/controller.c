#include "controller.h"

#include "rotation.h"

/* Share of the weight that the attitude is taken from at least: a force that points down or is tiny has none. */
#define LEAST_FORCE 0.2f

/* Force (N, world) that the position loop wants, with its tilt limited. */
static perch_vector desired_force(const perch_estimate *e, const perch_vector *integral,
                                  const perch_motion *target, const perch_vehicle *v) {
  const perch_vector *p = &target->position, *u = &target->velocity, *a = &target->acceleration;
  const float mass = v->gain_mass;
  perch_vector force = {
      -v->gain_kp_xy * (e->position.x - p->x) - v->gain_kd_xy * (e->velocity.x - u->x) -
          v->gain_ki_xy * integral->x + mass * a->x,
      -v->gain_kp_xy * (e->position.y - p->y) - v->gain_kd_xy * (e->velocity.y - u->y) -
          v->gain_ki_xy * integral->y + mass * a->y,
      -v->gain_kp_z * (e->position.z - p->z) - v->gain_kd_z * (e->velocity.z - u->z) -
          v->gain_ki_z * integral->z + mass * (a->z + PERCH_GRAVITY),
  };
  const float most = v->gain_tilt_tangent * perch_max(force.z, LEAST_FORCE * mass * PERCH_GRAVITY);
  const float lateral_squared = force.x * force.x + force.y * force.y;
  if (lateral_squared > most * most) {
    const float scale = most / sqrtf(lateral_squared);
    force.x *= scale;
    force.y *= scale;
  }
  return force;
}

static perch_vector scaled_to_one(const perch_vector *v) {
  const float inverse = 1.0f / perch_norm(v);
  return (perch_vector){v->x * inverse, v->y * inverse, v->z * inverse};
}

/* e_R = 1/2 vee(R_d^T R - R^T R_d), R_d from the direction of `force` and the heading; body frame. */
static perch_vector attitude_error(const perch_quaternion *quaternion, const perch_vector *force, float yaw) {
  const perch_vector d3 = scaled_to_one(force);
  const float c = yaw != 0.0f ? cosf(yaw) : 1.0f, s = yaw != 0.0f ? sinf(yaw) : 0.0f;
  const perch_vector across = {-d3.z * s, d3.z * c, d3.x * s - d3.y * c};
  const perch_vector d2 = scaled_to_one(&across);
  const perch_vector d1 = {d2.y * d3.z - d2.z * d3.y, d2.z * d3.x - d2.x * d3.z, d2.x * d3.y - d2.y * d3.x};
  const perch_vector b1 = perch_body_x(quaternion), b2 = perch_body_y(quaternion), b3 = perch_body_z(quaternion);
  return (perch_vector){
      0.5f * (perch_dot(&d3, &b2) - perch_dot(&d2, &b3)),
      0.5f * (perch_dot(&d1, &b3) - perch_dot(&d3, &b1)),
      0.5f * (perch_dot(&d2, &b1) - perch_dot(&d1, &b2)),
  };
}

/* -kr e_R - kw Omega + Omega x J Omega, with `collective`. */
static perch_wrench with_moments(float collective, const perch_vector *error, const perch_vector *omega,
                                 const perch_vehicle *v) {
  const perch_vector *w = omega;
  const float jx = v->gain_inertia_xx, jy = v->gain_inertia_yy, jz = v->gain_inertia_zz;
  return (perch_wrench){
      .collective = collective,
      .tau_x = -v->gain_kr_xy * error->x - v->gain_kw_xy * w->x + (jz - jy) * w->y * w->z,
      .tau_y = -v->gain_kr_xy * error->y - v->gain_kw_xy * w->y + (jx - jz) * w->z * w->x,
      .tau_z = -v->gain_kr_z * error->z - v->gain_kw_z * w->z + (jy - jx) * w->x * w->y,
  };
}

perch_wrench perch_geometric_control(const perch_estimate *estimate, const perch_vector *integral,
                                     const perch_motion *target, float yaw, const perch_vehicle *v) {
  const perch_vector force = desired_force(estimate, integral, target, v);
  const float least_z = LEAST_FORCE * v->gain_mass * PERCH_GRAVITY;
  const perch_vector tilting = {force.x, force.y, perch_max(force.z, least_z)};
  const perch_vector error = attitude_error(&estimate->quaternion, &tilting, yaw);
  const perch_vector b3 = perch_body_z(&estimate->quaternion);
  const float collective =
      perch_clamp(perch_dot(&force, &b3), v->gain_collective_min, v->gain_collective_max);
  return with_moments(collective, &error, &estimate->gyro, v);
}

perch_wrench perch_attitude_control(const perch_quaternion *quaternion, const perch_vector *omega,
                                    float collective, float yaw, const perch_vehicle *vehicle) {
  const perch_vector up = {0.0f, 0.0f, 1.0f};
  const perch_vector error = attitude_error(quaternion, &up, yaw);
  return with_moments(collective, &error, omega, vehicle);
}

static float lead(float moment, float *lagged, const perch_vehicle *v, float dt) {
  const float difference = moment - *lagged;
  if (!isfinite(difference)) {
    return moment;
  }
  const float per_time = 1.0f / (v->gain_lead_pole + dt);
  *lagged += dt * per_time * difference;
  return moment + (v->gain_lead_zero - v->gain_lead_pole) * per_time * difference;
}

perch_wrench perch_lead_moments(const perch_wrench *wrench, perch_vector *lagged, const perch_vehicle *vehicle,
                                float dt) {
  return (perch_wrench){
      .collective = wrench->collective,
      .tau_x = lead(wrench->tau_x, &lagged->x, vehicle, dt),
      .tau_y = lead(wrench->tau_y, &lagged->y, vehicle, dt),
      .tau_z = lead(wrench->tau_z, &lagged->z, vehicle, dt),
  };
}
