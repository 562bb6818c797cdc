/* A rehearsal on the desk, as the shell guards it: beside the core, which gives no thrust then either. */
#ifndef PERCH_DESK_H
#define PERCH_DESK_H

#include <stdbool.h>
#include <stdint.h>

#include "stabilizer_types.h"

/* Begin or end a rehearsal (a perch_rehearsal); says whether it is on now. */
bool perch_switch_rehearsal(uint8_t wanted);

/* The core has ended it. */
void perch_note_rehearsal_ended(void);

/* Whether it is on. */
bool perch_is_on_the_desk(void);

/* Whether a motor was given a thrust in the ms before, whoever did it. */
bool perch_sees_thrust(void);

/* Nothing turns, and nothing stays armed. */
void perch_stay_on_the_desk(control_t *control);

#endif
