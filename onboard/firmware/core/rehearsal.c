#include "rehearsal.h"

#include <string.h>

#define STEP_S 0.001f

uint8_t perch_rehearse(perch_core *core, uint8_t wanted, bool at_rest) {
  const bool goes_on = core->rehearses != PERCH_NO_REHEARSAL && wanted == core->rehearses;
  const bool may = at_rest && wanted <= PERCH_ON_MODEL && (goes_on || core->landing.state == PERCH_IDLE);
  core->rehearses = may ? wanted : PERCH_NO_REHEARSAL;
  return core->rehearses;
}

/* What was armed for the desk must not wait for a flight. */
static void forget(perch_core *core, uint32_t tick) {
  perch_record_end(&core->recorder, tick);
  core->landing.state = PERCH_IDLE;
  core->landing.attitude_known = false; /* own: that of the model, perhaps upside down */
  core->landing.trajectory_status = PERCH_TRAJECTORY_NONE;
  core->outputs.trajectory_status = PERCH_TRAJECTORY_NONE;
  core->consumed = core->posted;
  core->trajectory_armed = core->landing.arm_seen = false;
  core->policy_armed = core->go = core->abort = false;
}

/* The model hovers at `position`, and nothing of an earlier flight is left. */
static void start_model(perch_core *core, const perch_vector *position) {
  perch_start_model(&core->model, position, core->vehicle);
  memset(&core->follower, 0, sizeof core->follower);
  memset(&core->lagged, 0, sizeof core->lagged);
  core->landing.attitude_known = false; /* own: it begins anew with the estimate */
  core->outputs.motion = (perch_motion){.position = *position};
}

uint8_t perch_watch_rehearsal(perch_core *core, const perch_inputs *in) {
  const uint8_t was = core->rehearsed;
  const bool begun = was != PERCH_NO_REHEARSAL || core->rehearses != PERCH_NO_REHEARSAL;
  if (in->flying || in->thrust_seen) {
    core->rehearses = PERCH_NO_REHEARSAL;
  }
  core->rehearsed = core->rehearses;
  if (core->rehearsed == PERCH_ON_MODEL && was != PERCH_ON_MODEL) {
    const perch_vector origin = {0.0f, 0.0f, 0.0f};
    start_model(core, &origin);
  }
  if (core->rehearsed != PERCH_NO_REHEARSAL || !begun) {
    return 0;
  }
  forget(core, in->tick);
  return PERCH_REHEARSAL_ENDED;
}

/* An approach that is about to be armed finds the model at its start. */
static void go_to_start(perch_core *core) {
  const perch_plan *plan = &core->request.plan;
  const perch_vector start = {plan->x0, plan->y0, plan->z0};
  const bool arms = core->posted != core->consumed && core->request.armed && core->landing.state == PERCH_IDLE;
  if (arms && perch_is_finite(&start)) {
    start_model(core, &start);
  }
}

perch_inputs perch_as_in_flight(perch_core *core, const perch_inputs *in) {
  perch_inputs inputs = *in;
  perch_motion here = {.position = in->estimate.position};
  if (core->rehearsed == PERCH_ON_MODEL) {
    go_to_start(core);
    inputs.estimate = core->model.estimate;
    inputs.pose_age = 0;
    here.position = core->outputs.motion.position; /* where it was started, or where a hold left it */
  }
  inputs.flying = true;
  inputs.levelling = false;
  inputs.setpoint = perch_setpoint_of(&here);
  return inputs;
}

void perch_move_model(perch_core *core, uint32_t tick) {
  if (core->rehearsed != PERCH_ON_MODEL) {
    return;
  }
  if (tick % PERCH_CONTROL_PERIOD_MS == 0) { /* in between they have been taken back */
    memcpy(core->model.asked, core->outputs.thrusts, sizeof core->model.asked);
  }
  perch_fly_model(&core->model, core->vehicle, STEP_S);
}

void perch_keep_still(perch_outputs *outputs) {
  memset(outputs->thrusts, 0, sizeof outputs->thrusts);
  memset(outputs->duties, 0, sizeof outputs->duties);
  outputs->events &= (uint8_t)~(PERCH_HANDED_OVER | PERCH_CUT_MOTORS);
}
