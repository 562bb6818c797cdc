/* From a commander's setpoint to what the controller tracks: take-off, hover, level-out, approach.
 *
 * Both loops 500 Hz (onboard/follower.py). Between two setpoints the last one moves on with its velocity and
 * acceleration, for at most 0.1 s: no jolts for the lead of the moments. An axis that is given as a velocity
 * follows a position that moves with it, at most 0.3 m ahead of the drone. */
#ifndef PERCH_FOLLOWER_H
#define PERCH_FOLLOWER_H

#include "controller.h"

enum { PERCH_CONTROL_PERIOD_MS = 2 };

typedef enum { PERCH_MODE_DISABLED = 0, PERCH_MODE_ABSOLUTE = 1, PERCH_MODE_VELOCITY = 2 } perch_mode;

/* A setpoint in SI and FLU signs; all modes DISABLED and no thrust: the motors stop. Velocity x and y are in the
 * body's heading with `velocity_body`. */
typedef struct {
  uint8_t mode[3]; /* x, y, z; a perch_mode */
  uint8_t mode_roll, mode_pitch, mode_yaw, mode_quaternion;
  bool velocity_body;
  perch_vector position, velocity, acceleration;
  float roll, pitch, yaw;
  perch_vector rates;
  perch_quaternion quaternion;
  float thrust; /* 0..65535, where z is DISABLED */
  float age;    /* s since it was given */
} perch_setpoint;

typedef struct {
  float position[3], velocity[3], acceleration[3];
  float yaw;
  perch_vector rates;
  float integral[3];
  bool tracked[3];
  bool following[3], following_yaw; /* a velocity, since the step before */
} perch_follower;

bool perch_setpoint_is_null(const perch_setpoint *setpoint);

/* The setpoint of a motion at heading 0. */
perch_setpoint perch_setpoint_of(const perch_motion *motion);

/* What to track, at 500 Hz. */
void perch_follow(perch_follower *follower, const perch_setpoint *setpoint, const perch_estimate *estimate,
                  const perch_vehicle *vehicle);

/* The wrench that tracks it, at 500 Hz. */
perch_wrench perch_track(const perch_follower *follower, const perch_estimate *estimate,
                         const perch_vehicle *vehicle);

#endif
