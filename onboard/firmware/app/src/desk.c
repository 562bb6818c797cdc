#include "desk.h"

#include "log.h"
#include "shell.h"
#include "supervisor.h"

/* Not the parameter itself: a host that writes it in flight must not stop a motor before it is refused. */
static volatile bool is_on;

bool perch_sees_thrust(void) {
  static const char *const names[STABILIZER_NR_OF_MOTORS] = {"m1", "m2", "m3", "m4"};
  static logVarId_t ids[STABILIZER_NR_OF_MOTORS] = {0xffffu, 0xffffu, 0xffffu, 0xffffu};
  for (int i = 0; i < STABILIZER_NR_OF_MOTORS; i++) {
    if (!logVarIdIsValid(ids[i])) {
      ids[i] = logGetVarId("motor", names[i]);
    }
    if (!logVarIdIsValid(ids[i]) || logGetUint(ids[i]) != 0) {
      return true; /* what cannot be seen may turn */
    }
  }
  return false;
}

bool perch_switch_rehearsal(uint8_t wanted) {
  const bool at_rest = !supervisorIsArmed() && !supervisorIsFlying() && perch_is_configured() && !perch_sees_thrust();
  is_on = wanted != PERCH_NO_REHEARSAL && at_rest; /* before the core, which may end it at once */
  if (perch_rehearse(&perch, wanted, at_rest) == PERCH_NO_REHEARSAL) {
    is_on = false;
  } else if (!is_on) { /* the end of another one came in between, and has taken this guard away */
    perch_rehearse(&perch, PERCH_NO_REHEARSAL, at_rest);
  }
  return is_on;
}

void perch_note_rehearsal_ended(void) { is_on = false; }

bool perch_is_on_the_desk(void) { return is_on; }

void perch_stay_on_the_desk(control_t *control) {
  if (supervisorIsArmed()) {
    supervisorRequestArming(false);
  }
  control->controlMode = controlModeForce;
  for (int i = 0; i < STABILIZER_NR_OF_MOTORS; i++) {
    control->normalizedForces[i] = 0.0f;
  }
}
