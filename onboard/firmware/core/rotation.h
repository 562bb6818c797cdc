/* Rotations (onboard/rotation.py). */
#ifndef PERCH_ROTATION_H
#define PERCH_ROTATION_H

#include "vector.h"

/* Rotate by `b`, then by `a`. */
perch_quaternion perch_multiply(const perch_quaternion *a, const perch_quaternion *b);

/* Unit length; NaN in every part when `q` has no direction or no finite length. */
perch_quaternion perch_normalise(const perch_quaternion *q);

/* Body axes (forward, left, up) in the world frame. */
perch_vector perch_body_x(const perch_quaternion *q);
perch_vector perch_body_y(const perch_quaternion *q);
perch_vector perch_body_z(const perch_quaternion *q);

/* The rotation by |r| rad about r. */
perch_quaternion perch_from_rotation_vector(const perch_vector *r);

/* `q` after `dt` s of the body rate `omega` (rad/s), normalised. */
perch_quaternion perch_integrate(const perch_quaternion *q, const perch_vector *omega, float dt);

/* Roll, pitch (positive nose down), yaw in rad: turns about z, y, x of the moving body. */
perch_vector perch_euler_angles(const perch_quaternion *q);

#endif
