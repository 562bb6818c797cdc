#include "mixer.h"

#include "vector.h"

static float least_of(float a, float b, float c, float d) {
  return perch_min(perch_min(perch_min(a, b), c), d);
}

void perch_mix(const perch_wrench *wrench, const perch_vehicle *vehicle, float thrusts[4]) {
  const float top = vehicle->thrust_max;
  float roll = wrench->tau_x / (4.0f * vehicle->arm_y);
  float pitch = wrench->tau_y / (4.0f * vehicle->arm_x);
  float reach = fabsf(roll) + fabsf(pitch);
  if (reach > 0.5f * top) {
    roll *= 0.5f * top / reach;
    pitch *= 0.5f * top / reach;
    reach = 0.5f * top;
  }
  const float base = perch_clamp(0.25f * wrench->collective, reach, top - reach);
  const float m1 = base - roll - pitch;
  const float m2 = base - roll + pitch;
  const float m3 = base + roll + pitch;
  const float m4 = base + roll - pitch;
  /* Yaw adds to M2 and M4 and takes from M1 and M3. */
  const float most = least_of(m1, m3, top - m2, top - m4);
  const float least = -least_of(m2, m4, top - m1, top - m3);
  const float yaw = perch_clamp(wrench->tau_z / (4.0f * vehicle->thrust_to_torque), least, most);
  thrusts[0] = perch_clamp(m1 - yaw, 0.0f, top);
  thrusts[1] = perch_clamp(m2 + yaw, 0.0f, top);
  thrusts[2] = perch_clamp(m3 - yaw, 0.0f, top);
  thrusts[3] = perch_clamp(m4 + yaw, 0.0f, top);
}

void perch_flip_thrusts(float a_rot, const perch_vehicle *vehicle, float thrusts[4]) {
  const float each = perch_min(fabsf(a_rot) / (2.0f * vehicle->arm_x), vehicle->thrust_max);
  const float front = a_rot < 0.0f ? each : 0.0f;
  const float back = a_rot > 0.0f ? each : 0.0f;
  thrusts[0] = front;
  thrusts[1] = back;
  thrusts[2] = back;
  thrusts[3] = front;
}
