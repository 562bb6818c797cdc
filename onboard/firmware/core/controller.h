/* Geometric tracking controller on SE(3) (onboard/controller.py). */
#ifndef PERCH_CONTROLLER_H
#define PERCH_CONTROLLER_H

#include "approach.h"
#include "mixer.h"
#include "vector.h"
#include "vehicle.h"

/* The drone's own estimate: m, m/s, world; body to world; and the gyro, rad/s, body. */
typedef struct {
  perch_vector position, velocity;
  perch_quaternion quaternion;
  perch_vector gyro;
} perch_estimate;

/* Collective and moments that track `target` at heading `yaw` (rad), with the position `integral` (m s). */
perch_wrench perch_geometric_control(const perch_estimate *estimate, const perch_vector *integral,
                                     const perch_motion *target, float yaw, const perch_vehicle *vehicle);

/* `collective` (N) and the moments that hold the body level at heading `yaw`, whatever its position. */
perch_wrench perch_attitude_control(const perch_quaternion *quaternion, const perch_vector *omega,
                                    float collective, float yaw, const perch_vehicle *vehicle);

/* The wrench whose moments lead by (lead_zero s + 1) / (lead_pole s + 1), `dt` s after the last one: it undoes part
 * of the motors' lag. `lagged` is its memory, zeros while the motors stand. A moment of NaN passes, and leaves it. */
perch_wrench perch_lead_moments(const perch_wrench *wrench, perch_vector *lagged, const perch_vehicle *vehicle,
                                float dt);

#endif
