/* From collective and moments to the thrusts of the four motors (onboard/mixer.py). */
#ifndef PERCH_MIXER_H
#define PERCH_MIXER_H

#include "vehicle.h"

/* N, N m about the body's axes. */
typedef struct {
  float collective, tau_x, tau_y, tau_z;
} perch_wrench;

/* Thrusts (N) of M1 front right, M2 back right, M3 back left, M4 front left, each within 0 and the most.
 * Attitude comes first: roll and pitch are kept, the collective moves, yaw gets what room is left. */
void perch_mix(const perch_wrench *wrench, const perch_vehicle *vehicle, float thrusts[4]);

/* Thrusts that flip with `a_rot` (N m, negative nose up): two motors run, two stop; all stop for NaN. */
void perch_flip_thrusts(float a_rot, const perch_vehicle *vehicle, float thrusts[4]);

#endif
