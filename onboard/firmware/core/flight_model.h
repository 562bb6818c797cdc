/* A small model of the vehicle: it flies in the place of estimator and gyro when a drone rehearses by itself
 * (onboard/flight_model.py).
 *
 * A rigid body whose four thrusts follow with a first-order lag. It knows no air, no ceiling, no floor and no noise, and
 * takes the battery's compensation for perfect. */
#ifndef PERCH_FLIGHT_MODEL_H
#define PERCH_FLIGHT_MODEL_H

#include "controller.h"

typedef struct {
  perch_estimate estimate; /* its state, as a perfect estimator and a perfect gyro tell it */
  float thrusts[4];        /* N that the motors have, M1 to M4 */
  float asked[4];          /* N that they are asked for, until somebody asks for others */
} perch_flight_model;

/* It hovers at `position`: level, still, with thrusts that carry it. */
void perch_start_model(perch_flight_model *model, const perch_vector *position, const perch_vehicle *vehicle);

/* It flies for `dt` s. Second order; a motor that is asked for what is no number stops. */
void perch_fly_model(perch_flight_model *model, const perch_vehicle *vehicle, float dt);

#endif
