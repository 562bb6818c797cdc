#include "rehearsal.h"

#include <string.h>

bool perch_rehearse(perch_core *core, bool on, bool at_rest) {
  core->rehearses = on && at_rest && (core->rehearses || core->landing.state == PERCH_IDLE);
  return core->rehearses;
}

/* What was armed for the desk must not wait for a flight. */
static void forget(perch_core *core, uint32_t tick) {
  perch_record_end(&core->recorder, tick);
  core->landing.state = PERCH_IDLE;
  core->landing.trajectory_status = PERCH_TRAJECTORY_NONE;
  core->outputs.trajectory_status = PERCH_TRAJECTORY_NONE;
  core->consumed = core->posted;
  core->trajectory_armed = core->landing.arm_seen = false;
  core->policy_armed = core->go = core->abort = false;
}

uint8_t perch_watch_rehearsal(perch_core *core, const perch_inputs *in) {
  const bool begun = core->rehearsed || core->rehearses;
  if (in->flying || in->thrust_seen) {
    core->rehearses = false;
  }
  core->rehearsed = core->rehearses;
  if (core->rehearsed || !begun) {
    return 0;
  }
  forget(core, in->tick);
  return PERCH_REHEARSAL_ENDED;
}

perch_inputs perch_as_in_flight(const perch_inputs *in) {
  const perch_motion here = {.position = in->estimate.position};
  perch_inputs inputs = *in;
  inputs.flying = true;
  inputs.levelling = false;
  inputs.setpoint = perch_setpoint_of(&here);
  return inputs;
}

void perch_keep_still(perch_outputs *outputs) {
  memset(outputs->thrusts, 0, sizeof outputs->thrusts);
  memset(outputs->duties, 0, sizeof outputs->duties);
  outputs->events &= (uint8_t)~(PERCH_HANDED_OVER | PERCH_CUT_MOTORS);
}
