/* Optical-flow cues of an approach to the ceiling (onboard/cues.py). */
#include "policy.h"

perch_cues perch_optical_flow_cues(float z, float vx, float vz, float ceiling_z) {
  perch_cues cues;
  cues.d_ceil = ceiling_z - z;
  if (vz <= 0.0f) {
    cues.tau = INFINITY; /* does not approach */
  } else if (cues.d_ceil <= 0.0f) {
    cues.tau = 0.0f;
  } else {
    cues.tau = cues.d_ceil / vz;
  }
  if (cues.d_ceil <= 0.0f) {
    cues.theta_x = vx == 0.0f ? 0.0f : vx * INFINITY;
  } else {
    cues.theta_x = vx / cues.d_ceil;
  }
  return cues;
}
