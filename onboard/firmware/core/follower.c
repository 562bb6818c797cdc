#include "follower.h"

#include "rotation.h"

#define DT 0.002f             /* s, of both loops */
#define LEASH 0.3f            /* m that a position may run ahead */
#define FULL_THRUST 65535.0f  /* of a setpoint */
#define LEAST_UPRIGHT 0.3f    /* of b3.z: a tilt that is asked for is not calculated beyond 73 deg */
#define MOST_AGE 0.1f         /* s that a setpoint moves on by itself */

bool perch_setpoint_is_null(const perch_setpoint *s) {
  return s->thrust == 0.0f && !(s->mode[0] || s->mode[1] || s->mode[2] || s->mode_roll || s->mode_pitch ||
                                s->mode_yaw || s->mode_quaternion);
}

perch_setpoint perch_setpoint_of(const perch_motion *motion) {
  return (perch_setpoint){
      .mode = {PERCH_MODE_ABSOLUTE, PERCH_MODE_ABSOLUTE, PERCH_MODE_ABSOLUTE},
      .mode_yaw = PERCH_MODE_ABSOLUTE,
      .position = motion->position,
      .velocity = motion->velocity,
      .acceleration = motion->acceleration,
      .quaternion = {0.0f, 0.0f, 0.0f, 1.0f},
  };
}

static void follow_axis(perch_follower *f, int i, perch_mode mode, float here, float position, float velocity,
                        float acceleration, float age) {
  f->tracked[i] = mode != PERCH_MODE_DISABLED;
  f->acceleration[i] = mode == PERCH_MODE_ABSOLUTE ? acceleration : 0.0f;
  if (mode == PERCH_MODE_VELOCITY) {
    const float start = f->following[i] ? f->position[i] : here;
    f->position[i] = perch_clamp(start + velocity * DT, here - LEASH, here + LEASH);
    f->velocity[i] = velocity;
  } else {
    const float gained = f->acceleration[i] * age;
    f->position[i] = position + (velocity + 0.5f * gained) * age;
    f->velocity[i] = velocity + gained;
  }
  f->following[i] = mode == PERCH_MODE_VELOCITY;
}

static void follow_heading(perch_follower *f, const perch_setpoint *setpoint, float yaw, float age) {
  f->rates = setpoint->rates;
  if (setpoint->mode_quaternion == PERCH_MODE_ABSOLUTE) {
    f->yaw = perch_euler_angles(&setpoint->quaternion).z;
  } else if (setpoint->mode_yaw == PERCH_MODE_ABSOLUTE) {
    f->yaw = setpoint->yaw + setpoint->rates.z * age;
  } else {
    f->yaw = (f->following_yaw ? f->yaw : yaw) + setpoint->rates.z * DT;
  }
  f->following_yaw = setpoint->mode_yaw == PERCH_MODE_VELOCITY;
}

/* b3 of roll, pitch (rad, FLU) and yaw. */
static perch_vector up_of(float roll, float pitch, float yaw) {
  const float cz = cosf(0.5f * yaw), sz = sinf(0.5f * yaw);
  const float cy = cosf(0.5f * pitch), sy = sinf(0.5f * pitch);
  const float cx = cosf(0.5f * roll), sx = sinf(0.5f * roll);
  const perch_quaternion q = {
      cz * cy * sx - sz * sy * cx,
      cz * sy * cx + sz * cy * sx,
      sz * cy * cx - cz * sy * sx,
      cz * cy * cx + sz * sy * sx,
  };
  return perch_body_z(&q);
}

/* Accelerations that tilt the body as asked; a rate keeps the present angle. */
static void follow_tilt(perch_follower *f, const perch_setpoint *setpoint, const perch_vector *angles,
                        const perch_vehicle *vehicle) {
  const float roll = setpoint->mode_roll == PERCH_MODE_VELOCITY ? angles->x : setpoint->roll;
  const float pitch = setpoint->mode_pitch == PERCH_MODE_VELOCITY ? angles->y : setpoint->pitch;
  const perch_vector up = up_of(roll, pitch, f->yaw);
  if (setpoint->mode[2] == PERCH_MODE_DISABLED) {
    const float thrust = setpoint->thrust / FULL_THRUST * 4.0f * vehicle->thrust_max / vehicle->mass;
    f->acceleration[0] = thrust * up.x;
    f->acceleration[1] = thrust * up.y;
    f->acceleration[2] = thrust * up.z - PERCH_GRAVITY;
  } else {
    const float upright = perch_max(up.z, LEAST_UPRIGHT);
    f->acceleration[0] = PERCH_GRAVITY * up.x / upright;
    f->acceleration[1] = PERCH_GRAVITY * up.y / upright;
  }
}

static void integrate_error(perch_follower *f, int i, float here, float limit) {
  const float error = (here - f->position[i]) * DT;
  if (f->tracked[i] && isfinite(error)) {
    f->integral[i] = perch_clamp(f->integral[i] + error, -limit, limit);
  }
}

void perch_follow(perch_follower *f, const perch_setpoint *s, const perch_estimate *estimate,
                  const perch_vehicle *vehicle) {
  const perch_vector *here = &estimate->position;
  const perch_vector angles = perch_euler_angles(&estimate->quaternion);
  const float age = s->age < MOST_AGE ? s->age : MOST_AGE;
  perch_vector velocity = s->velocity;
  if (s->velocity_body) {
    const float cosine = cosf(angles.z), sine = sinf(angles.z);
    velocity.x = cosine * s->velocity.x - sine * s->velocity.y;
    velocity.y = sine * s->velocity.x + cosine * s->velocity.y;
  }
  follow_axis(f, 0, (perch_mode)s->mode[0], here->x, s->position.x, velocity.x, s->acceleration.x, age);
  follow_axis(f, 1, (perch_mode)s->mode[1], here->y, s->position.y, velocity.y, s->acceleration.y, age);
  follow_axis(f, 2, (perch_mode)s->mode[2], here->z, s->position.z, velocity.z, s->acceleration.z, age);
  follow_heading(f, s, angles.z, age);
  if (s->mode[0] == PERCH_MODE_DISABLED) {
    follow_tilt(f, s, &angles, vehicle);
  }
  integrate_error(f, 0, here->x, vehicle->gain_integral_limit);
  integrate_error(f, 1, here->y, vehicle->gain_integral_limit);
  integrate_error(f, 2, here->z, vehicle->gain_integral_limit);
}

perch_wrench perch_track(const perch_follower *f, const perch_estimate *estimate, const perch_vehicle *vehicle) {
  const perch_vector *p = &estimate->position, *v = &estimate->velocity;
  perch_estimate turning = *estimate;
  turning.gyro.x -= f->rates.x;
  turning.gyro.y -= f->rates.y;
  turning.gyro.z -= f->rates.z;
  /* An axis that is not tracked has no error of position and velocity: only its acceleration acts. */
  const perch_motion target = {
      .position = {f->tracked[0] ? f->position[0] : p->x, f->tracked[1] ? f->position[1] : p->y,
                   f->tracked[2] ? f->position[2] : p->z},
      .velocity = {f->tracked[0] ? f->velocity[0] : v->x, f->tracked[1] ? f->velocity[1] : v->y,
                   f->tracked[2] ? f->velocity[2] : v->z},
      .acceleration = {f->acceleration[0], f->acceleration[1], f->acceleration[2]},
  };
  const perch_vector integral = {f->integral[0], f->integral[1], f->integral[2]};
  return perch_geometric_control(&turning, &integral, &target, f->yaw, vehicle);
}
