#include "core.h"

#include <string.h>

#include "battery.h"
#include "rehearsal.h"

enum { POLICY_PERIOD_MS = 10, HELD_ON_MS = 20 };

/* Period of landing machine and law, s. */
#define FULL_RATIO 65535.0f
#define STEP_S 0.002f

void perch_boot(perch_core *core, const perch_vehicle *vehicle) {
  const perch_approach nowhere = {0};
  memset(core, 0, sizeof *core);
  core->vehicle = vehicle;
  core->plan = perch_plan_approach(&nowhere);
  core->outputs.policy.cues.tau = INFINITY;
  core->outputs.filtered_voltage = PERCH_FULL_VOLTAGE;
}

/* Cues and policy on the estimate. */
static void evaluate(perch_core *core, const perch_inputs *in) {
  perch_policy_sample *sample = &core->outputs.policy;
  const perch_estimate *e = &in->estimate;
  const bool idle = core->landing.state == PERCH_IDLE;
  const float ceiling_z = idle ? core->idle_ceiling_z : core->plan.ceiling_z;
  sample->cues = perch_optical_flow_cues(e->position.z, e->velocity.x, e->velocity.z, ceiling_z);
  sample->trigger_value = sample->a_rot = 0.0f;
  if (core->policy_is_live) {
    sample->trigger_value = perch_trigger_value(&core->policy, &sample->cues);
    sample->a_rot = perch_action_moment(&core->policy, &sample->cues);
  }
}

static perch_landing_inputs landing_inputs(const perch_core *core, const perch_inputs *in) {
  const bool withdrawn = perch_setpoint_is_null(&in->setpoint) || in->levelling;
  return (perch_landing_inputs){
      .tick = in->tick,
      .pose_age = in->pose_age,
      .dt = STEP_S,
      .position = in->estimate.position,
      .velocity = in->estimate.velocity,
      .quaternion = in->estimate.quaternion,
      .gyro = in->estimate.gyro,
      .cues = core->outputs.policy.cues,
      .trigger_value = core->outputs.policy.trigger_value,
      .a_rot = core->outputs.policy.a_rot,
      .policy_tau_min = core->policy_is_live ? perch_tau_min(&core->policy) : NAN,
      .evaluated = core->policy_is_live && in->tick % POLICY_PERIOD_MS == 0,
      .policy_armed = core->policy_armed,
      .trajectory_armed = core->trajectory_armed,
      .go = core->go && !core->landing.go_seen,
      .abort = core->abort || (withdrawn && core->landing.state != PERCH_IDLE),
      .flying = in->flying,
  };
}

static bool is_same_plan(const perch_plan *a, const perch_plan *b) {
  return a->x0 == b->x0 && a->y0 == b->y0 && a->z0 == b->z0 && a->t_x == b->t_x && a->t_z == b->t_z &&
         a->vx == b->vx && a->vz == b->vz && a->ax == b->ax && a->az == b->az && a->tau0 == b->tau0 &&
         a->impact_x == b->impact_x && a->ceiling_z == b->ceiling_z;
}

/* Consume the posted request, once the machine has seen the switch as the last one left it. An armed approach
 * does not change: another plan first disarms, and is armed in the step after. */
static void take_request(perch_core *core) {
  const perch_request *request = &core->request;
  if (core->posted == core->consumed || core->trajectory_armed != core->landing.arm_seen) {
    return;
  }
  if (request->armed && core->landing.state == PERCH_TRAJECTORY_ARMED &&
      !is_same_plan(&request->plan, &core->plan)) {
    core->trajectory_armed = false;
    return;
  }
  core->trajectory_armed = request->armed;
  if (request->armed && core->landing.state == PERCH_IDLE) {
    core->plan = request->plan;
  }
  core->consumed = core->posted;
}

/* Each flag counts for one step. */
static uint8_t clear_flags(perch_core *core, const perch_landing_inputs *in) {
  uint8_t events = 0;
  if (in->go) {
    core->go = false;
    events |= PERCH_GO_TAKEN;
  }
  if (core->abort) {
    core->abort = false;
    events |= PERCH_ABORT_TAKEN;
  }
  return events;
}

/* Say what the machine makes of the last request, unless one is still to be consumed. */
static uint8_t answer(perch_core *core) {
  if (core->posted != core->consumed) {
    return 0;
  }
  core->outputs.trajectory_status = core->landing.trajectory_status;
  if (core->landing.trajectory_status >= PERCH_TRAJECTORY_REFUSED_TOO_FAR && core->trajectory_armed) {
    core->trajectory_armed = false;
    return PERCH_REFUSED;
  }
  return 0;
}

/* What a change of the machine's state means for others. */
static uint8_t change(perch_core *core, const perch_inputs *in, uint8_t was) {
  const uint8_t is = core->landing.state;
  if (is == was) {
    return 0;
  }
  if (is == PERCH_TRAJECTORY_ARMED) {
    perch_record_begin(&core->recorder);
  } else if (was == PERCH_APPROACH) {
    perch_record_end(&core->recorder, in->tick);
  }
  if (is == PERCH_CUT || is == PERCH_FAULT) {
    return PERCH_CUT_MOTORS;
  }
  return was == PERCH_HOLD && is == PERCH_IDLE && !perch_setpoint_is_null(&in->setpoint) ? PERCH_HANDED_OVER : 0;
}

/* Handed over, the hold stays in force until the planner speaks: it does so every 10 ms, and what it said last is
 * still its old goal, perhaps metres away. */
static bool holds_on(const perch_core *core, const perch_inputs *in) {
  const bool begins = core->outputs.events & PERCH_HANDED_OVER;
  const uint32_t ms = in->tick - core->landing.usable_tick;
  return (begins || core->holds_on) && core->landing.state == PERCH_IDLE && ms < HELD_ON_MS &&
         in->setpoint.age > 1e-3f * ((float)ms - 0.5f);
}

static perch_landing_output step_machine(perch_core *core, const perch_inputs *in) {
  const uint8_t was = core->landing.state;
  take_request(core);
  const perch_landing_inputs inputs = landing_inputs(core, in);
  perch_landing_output output = perch_landing_step(&core->landing, &inputs, &core->plan, core->vehicle);
  core->outputs.events = (uint8_t)(clear_flags(core, &inputs) | answer(core) | change(core, in, was));
  core->holds_on = holds_on(core, in);
  if (core->holds_on) {
    output.mode = PERCH_SETPOINT;
    output.motion = perch_hold_motion(&core->landing, in->tick, &core->plan, core->vehicle);
  }
  core->outputs.mode = (uint8_t)output.mode;
  if (output.mode == PERCH_SETPOINT) {
    core->outputs.motion = output.motion;
  }
  return output;
}

/* Forget what was followed. */
static void stop(perch_core *core) {
  memset(&core->follower, 0, sizeof core->follower);
  memset(&core->lagged, 0, sizeof core->lagged);
  memset(&core->outputs.wrench, 0, sizeof core->outputs.wrench);
  memset(core->outputs.thrusts, 0, sizeof core->outputs.thrusts);
}

/* The control law's wrench, every 2 ms: lead, then mixer. */
static void apply(perch_core *core, const perch_wrench *wanted) {
  core->outputs.wrench = perch_lead_moments(wanted, &core->lagged, core->vehicle, STEP_S);
  perch_mix(&core->outputs.wrench, core->vehicle, core->outputs.thrusts);
}

static void follow(perch_core *core, const perch_inputs *in, const perch_setpoint *setpoint) {
  perch_follow(&core->follower, setpoint, &in->estimate, core->vehicle);
  const perch_wrench wanted = perch_track(&core->follower, &in->estimate, core->vehicle);
  apply(core, &wanted);
}

static void level(perch_core *core, const perch_inputs *in, float collective) {
  const perch_wrench wanted = perch_attitude_control(&core->landing.attitude, &in->estimate.gyro, collective, 0.0f,
                                                     core->vehicle);
  apply(core, &wanted);
}

/* One step of the law, as the landing machine wants it. */
static void fly(perch_core *core, const perch_inputs *in, const perch_landing_output *output) {
  switch (output->mode) {
    case PERCH_PASS:
      follow(core, in, &in->setpoint);
      break;
    case PERCH_SETPOINT: {
      const perch_setpoint setpoint = perch_setpoint_of(&output->motion);
      follow(core, in, &setpoint);
      break;
    }
    case PERCH_LEVEL:
      level(core, in, output->collective);
      break;
    case PERCH_THRUSTS: /* past the controller */
      memcpy(core->outputs.thrusts, output->thrusts, sizeof core->outputs.thrusts);
      break;
    case PERCH_OFF:
      break;
  }
}

/* Battery compensation of the thrusts. */
static void compensate(perch_core *core, float voltage) {
  perch_outputs *out = &core->outputs;
  out->filtered_voltage = perch_filter_voltage(out->filtered_voltage, voltage);
  for (int i = 0; i < 4; i++) {
    out->duties[i] = perch_duty(core->vehicle, out->thrusts[i], out->filtered_voltage);
  }
}

static void record(perch_core *core, const perch_inputs *in) {
  if (!perch_is_recorded(&core->recorder, in->tick)) {
    return;
  }
  perch_law_sample law = {
      .estimate = in->estimate,
      .own_attitude = core->landing.attitude,
      .voltage = core->outputs.filtered_voltage,
  };
  memcpy(law.thrusts, core->outputs.thrusts, sizeof law.thrusts);
  perch_record(&core->recorder, in->tick, &core->outputs.policy, &law);
}

/* Mean of the law's last steps, as motor ratios. */
static void average(perch_core *core, uint32_t tick) {
  perch_outputs *out = &core->outputs;
  uint16_t *newest = core->recent_ratios[tick / PERCH_CONTROL_PERIOD_MS % PERCH_AVERAGED_STEPS];
  for (int motor = 0; motor < 4; motor++) {
    newest[motor] = (uint16_t)(out->duties[motor] * FULL_RATIO);
    uint32_t sum = 0;
    for (int step = 0; step < PERCH_AVERAGED_STEPS; step++) {
      sum += core->recent_ratios[step][motor];
    }
    out->mean_ratios[motor] = (uint16_t)(sum / PERCH_AVERAGED_STEPS);
  }
}

static void report(perch_core *core) {
  perch_outputs *out = &core->outputs;
  out->state = core->landing.state;
  out->reason = core->landing.reason;
  out->trajectory_armed = core->trajectory_armed;
  out->policy_armed = core->policy_armed;
  out->rehearses = core->rehearsed != PERCH_NO_REHEARSAL;
}

/* Whether nothing may turn: the app never runs the motors against a null setpoint. */
static bool is_off(const perch_core *core, const perch_inputs *in) {
  return core->outputs.mode == PERCH_OFF || perch_setpoint_is_null(&in->setpoint);
}

/* Landing machine and law. */
static void step_all(perch_core *core, const perch_inputs *in) {
  if (in->tick % POLICY_PERIOD_MS == 0) {
    evaluate(core, in);
  }
  const perch_landing_output output = step_machine(core, in);
  if (!is_off(core, in)) {
    fly(core, in, &output);
  }
}

/* One ms of a drone that flies, or rehearses. */
static void compute(perch_core *core, const perch_inputs *in) {
  if (in->tick % PERCH_CONTROL_PERIOD_MS == 0) {
    step_all(core, in);
  }
  if (is_off(core, in)) {
    stop(core);
  }
  compensate(core, in->voltage);
  record(core, in);
}

void perch_resume(perch_core *core) {
  core->abort = true;
  core->landing.attitude_known = false; /* nobody followed the gyro */
}

void perch_give_way(perch_core *core) {
  memset(core->follower.integral, 0, sizeof core->follower.integral);
}

void perch_step(perch_core *core, const perch_inputs *in) {
  core->outputs.events = 0;
  const uint8_t ended = perch_watch_rehearsal(core, in);
  if (core->rehearsed != PERCH_NO_REHEARSAL) {
    const perch_inputs inputs = perch_as_in_flight(core, in);
    compute(core, &inputs);
    perch_move_model(core, in->tick);
    perch_keep_still(&core->outputs);
  } else {
    compute(core, in);
  }
  if (in->tick % PERCH_CONTROL_PERIOD_MS == 0) {
    average(core, in->tick);
  }
  core->outputs.events |= ended;
  report(core);
}
