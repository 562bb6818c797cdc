/* The approach to the ceiling: along x, then along z, then at constant velocity (onboard/trajectory.py). */
#ifndef PERCH_APPROACH_H
#define PERCH_APPROACH_H

#include "vector.h"

/* s from the start, m, world frame; the fields of ApproachPlan. */
typedef struct {
  float x0, y0, z0;
  float t_x, t_z;
  float vx, vz;
  float ax, az;
  float tau0;
  float impact_x;
  float ceiling_z;
} perch_plan;

/* What the ground says about an approach: its parameters. */
typedef struct {
  float vx, vz, impact_x, impact_y, ceiling_z, ax, az, tau0;
} perch_approach;

/* Where to be, how fast, with what acceleration: m, world frame. */
typedef struct {
  perch_vector position, velocity, acceleration;
} perch_motion;

/* The plan of an approach; one of NaNs, which is not sound, for accelerations that are not above 0. */
perch_plan perch_plan_approach(const perch_approach *approach);

/* Whether the numbers make an approach that climbs, and not from below `start_z_min` (m). */
bool perch_approach_is_sound(const perch_plan *plan, float start_z_min);

/* The approach `t` s after its start, its steps of acceleration rounded off over `half_width` (s) to both
 * sides; `jerk_z` in m/s3. */
perch_motion perch_smooth_approach(const perch_plan *plan, float t, float half_width, float *jerk_z);

#endif
