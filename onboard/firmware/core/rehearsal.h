/* A rehearsal on the desk: everything is computed as in flight, and nothing turns.
 *
 * The drone believes to be where poses say that the ground sends, or where its own model of the vehicle flies, which
 * then has the place of estimator, gyro and poses. While it is on, the landing machine takes the drone for one that
 * flies and hovers, and no thrust leaves the core. It begins with a drone at rest alone, and ends as soon as somebody
 * flies or a motor has a thrust; then everything that was armed is forgotten. */
#ifndef PERCH_REHEARSAL_H
#define PERCH_REHEARSAL_H

#include "core.h"

/* End the rehearsal where it must; to be called first in each step. Gives PERCH_REHEARSAL_ENDED or 0. */
uint8_t perch_watch_rehearsal(perch_core *core, const perch_inputs *in);

/* Inputs of a drone that flies and stays where it believes to be, or where its model shall be. */
perch_inputs perch_as_in_flight(perch_core *core, const perch_inputs *in);

/* The model flies for a ms, by the thrusts of the law's last step. */
void perch_move_model(perch_core *core, uint32_t tick);

/* Take back what the step gave to the motors and to the planner. */
void perch_keep_still(perch_outputs *outputs);

#endif
