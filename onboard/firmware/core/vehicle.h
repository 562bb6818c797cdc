/* The constants of one vehicle, in the order of onboard/firmware/constants.py; SI, angles in rad.
 *
 * A firmware has those of the vehicle that it was built for, from the header that `perchhw vehicle header`
 * writes; the simulated drone fills them in when it starts. */
#ifndef PERCH_VEHICLE_H
#define PERCH_VEHICLE_H

#include <stdint.h>

/* Values of thrust_map_form. */
enum { PERCH_QUADRATIC_INVERSE = 0, PERCH_FIRMWARE_CUBIC = 1, PERCH_TWO_REGION_LOG = 2 };

enum { PERCH_MAP_COEFFICIENTS = 8 };

typedef struct {
  float mass;
  float inertia_xx, inertia_yy, inertia_zz;
  float arm_x, arm_y;
  float thrust_map_form;
  float thrust_map[PERCH_MAP_COEFFICIENTS];
  float thrust_max, thrust_min;
  float time_constant_up, time_constant_down;
  float thrust_to_torque;
  float gain_kp_xy, gain_kd_xy, gain_ki_xy;
  float gain_kp_z, gain_kd_z, gain_ki_z;
  float gain_integral_limit;
  float gain_kr_xy, gain_kw_xy, gain_kr_z, gain_kw_z;
  float gain_lead_zero, gain_lead_pole;
  float gain_tilt_tangent;
  float gain_collective_min, gain_collective_max;
  float gain_mass;
  float gain_inertia_xx, gain_inertia_yy, gain_inertia_zz;
  float limit_start_distance, limit_start_speed, limit_start_z_min;
  float limit_motor_lag, limit_motor_lag_up;
  float limit_smoothing, limit_latency, limit_thrust_reserve;
  float limit_brake_margin, limit_contact_distance;
  float limit_tilt_limit;
  float limit_flip_timeout, limit_pose_age_limit;
  float limit_speed_limit, limit_hold_distance, limit_useless_limit;
  float limit_lateral_limit, limit_hold_clearance, limit_hold_acceleration, limit_descent_speed;
} perch_vehicle;

enum { PERCH_VEHICLE_CONSTANTS = 60 };

_Static_assert(sizeof(perch_vehicle) == 4 * PERCH_VEHICLE_CONSTANTS, "60 float32 without gaps: perch.vehCrc");

/* What perch.vehCrc reads. */
uint32_t perch_vehicle_crc(const perch_vehicle *vehicle);

#endif
