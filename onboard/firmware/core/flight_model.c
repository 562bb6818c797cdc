#include "flight_model.h"

#include <string.h>

#include "rotation.h"

void perch_start_model(perch_flight_model *model, const perch_vector *position, const perch_vehicle *vehicle) {
  memset(model, 0, sizeof *model);
  model->estimate.position = *position;
  model->estimate.quaternion.w = 1.0f;
  for (int i = 0; i < 4; i++) {
    model->thrusts[i] = model->asked[i] = 0.25f * vehicle->mass * PERCH_GRAVITY;
  }
}

/* With the present velocities. */
static void drift(perch_estimate *e, float dt) {
  e->position.x += dt * e->velocity.x;
  e->position.y += dt * e->velocity.y;
  e->position.z += dt * e->velocity.z;
  e->quaternion = perch_integrate(&e->quaternion, &e->gyro, dt);
}

/* What a motor heads for: below its least thrust it stands still. */
static float target(float thrust, const perch_vehicle *v) {
  return thrust > v->thrust_min ? perch_min(thrust, v->thrust_max) : 0.0f;
}

/* `up` and `down`: what is left of an error of a rising and of a falling thrust. */
static void follow(perch_flight_model *model, const perch_vehicle *v, float up, float down) {
  for (int i = 0; i < 4; i++) {
    const float wanted = target(model->asked[i], v), error = model->thrusts[i] - wanted;
    model->thrusts[i] = wanted + error * (error < 0.0f ? up : down);
  }
}

/* Euler's equation. */
static perch_vector angular_acceleration(const perch_vector *w, const perch_vector *torque, const perch_vehicle *v) {
  const float jx = v->inertia_xx, jy = v->inertia_yy, jz = v->inertia_zz;
  return (perch_vector){
      (torque->x + (jy - jz) * w->y * w->z) / jx,
      (torque->y + (jz - jx) * w->z * w->x) / jy,
      (torque->z + (jx - jy) * w->x * w->y) / jz,
  };
}

static perch_vector turned_faster(const perch_vector *w, const perch_vector *acceleration, float dt) {
  return (perch_vector){w->x + dt * acceleration->x, w->y + dt * acceleration->y, w->z + dt * acceleration->z};
}

/* The velocities after `dt` s of the present thrusts; the rate by the midpoint rule. */
static void kick(perch_estimate *e, const float f[4], const perch_vehicle *v, float dt) {
  const perch_vector up = perch_body_z(&e->quaternion);
  const float gained = dt * (f[0] + f[1] + f[2] + f[3]) / v->mass;
  e->velocity.x += gained * up.x;
  e->velocity.y += gained * up.y;
  e->velocity.z += gained * up.z - dt * PERCH_GRAVITY;
  const perch_vector torque = {
      v->arm_y * (f[2] + f[3] - f[0] - f[1]),
      v->arm_x * (f[1] + f[2] - f[0] - f[3]),
      v->thrust_to_torque * (f[1] + f[3] - f[0] - f[2]),
  };
  const perch_vector first = angular_acceleration(&e->gyro, &torque, v);
  const perch_vector middle = turned_faster(&e->gyro, &first, 0.5f * dt);
  const perch_vector mean = angular_acceleration(&middle, &torque, v);
  e->gyro = turned_faster(&e->gyro, &mean, dt);
}

void perch_fly_model(perch_flight_model *model, const perch_vehicle *vehicle, float dt) {
  const float half = 0.5f * dt;
  const float up = expf(-half / vehicle->time_constant_up), down = expf(-half / vehicle->time_constant_down);
  drift(&model->estimate, half);
  follow(model, vehicle, up, down);
  kick(&model->estimate, model->thrusts, vehicle, dt);
  follow(model, vehicle, up, down);
  drift(&model->estimate, half);
}
