/* The firmware's hooks of an out-of-tree controller: one step of the core, and what it asks of the firmware. */
#include "controller.h"

#include "FreeRTOS.h"
#include "commander.h"
#include "controller_pid.h"
#include "crtp_commander_high_level.h"
#include "desk.h"
#include "pm.h"
#include "shell.h"
#include "supervisor.h"
#include "task.h"

#define RAD_PER_DEG 0.017453292519943295f

enum { LONGEST_GAP_MS = 5 };

/* s that the planner takes to stay where the drone is: it shall be there at once. */
#define STAY_S 0.01f

static uint32_t last_ms, trigger_ms, seen_count;
static bool has_run;

uint32_t perch_trigger_ms(void) { return trigger_ms; }

/* At the start, and whenever somebody chooses this controller again, in flight as well. */
void controllerOutOfTreeInit(void) { controllerPidInit(); }

bool controllerOutOfTreeTest(void) { return controllerPidTest() && perch.vehicle != NULL; }

static perch_inputs inputs_from(const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state,
                                stabilizerStep_t step) {
  const uint32_t now_ms = (uint32_t)xTaskGetTickCount();
  return (perch_inputs){
      .tick = step,
      .pose_age = perch_pose_age(now_ms),
      .estimate =
          {
              .position = {state->position.x, state->position.y, state->position.z},
              .velocity = {state->velocity.x, state->velocity.y, state->velocity.z},
              .quaternion = {state->attitudeQuaternion.x, state->attitudeQuaternion.y,
                             state->attitudeQuaternion.z, state->attitudeQuaternion.w},
              .gyro = {RAD_PER_DEG * sensors->gyro.x, RAD_PER_DEG * sensors->gyro.y,
                       RAD_PER_DEG * sensors->gyro.z},
          },
      .voltage = pmGetBatteryVoltage(),
      .flying = supervisorIsFlying(),
      .levelling = perch_is_level_out(setpoint),
      .thrust_seen = perch_is_on_the_desk() && perch_sees_thrust(),
      .setpoint = perch_setpoint_from(setpoint, now_ms),
  };
}

/* What a step means for the firmware's planner. */
static void tell_planner(uint8_t events) {
  if (events & (PERCH_CUT_MOTORS | PERCH_HANDED_OVER)) {
    crtpCommanderHighLevelStop();
  }
  if (events & PERCH_HANDED_OVER) {
    const perch_vector *p = &perch.outputs.motion.position;
    commanderRelaxPriority();
    crtpCommanderHighLevelGoTo2(p->x, p->y, p->z, 0.0f, STAY_S, false, false);
  }
}

static void note_trigger(uint32_t step) {
  if (perch.landing.snapshot.count != seen_count) {
    seen_count = perch.landing.snapshot.count;
    trigger_ms = (uint32_t)xTaskGetTickCount() - (step - perch.landing.snapshot.tick);
  }
}

/* While the app leaves the drone to whoever flew before, the firmware's own controller may have it. */
static bool is_delegated(void) { return perch.outputs.mode == PERCH_PASS && perch_ground.own_law == 0; }

void controllerOutOfTree(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors,
                         const state_t *state, const stabilizerStep_t stabilizerStep) {
  /* Somebody else had the motors for a while. The loop does not count its steps in a health test: time tells. */
  const uint32_t now_ms = (uint32_t)xTaskGetTickCount();
  if (has_run && now_ms - last_ms > LONGEST_GAP_MS) {
    perch_resume(&perch);
  }
  last_ms = now_ms;
  has_run = true;

  const perch_inputs inputs = inputs_from(setpoint, sensors, state, stabilizerStep);
  if (inputs.flying && !perch_is_configured()) {
    perch_ask_abort(&perch, true);
  }
  perch_step(&perch, &inputs);
  note_trigger(stabilizerStep);
  tell_planner(perch.outputs.events);
  perch_answer_ground(perch.outputs.events);

  if (perch_is_on_the_desk()) {
    perch_stay_on_the_desk(control);
    return;
  }
  /* Nothing takes off in a wrong configuration, whose law it is; what flies when somebody changes it does not fall. */
  const bool may_turn = inputs.flying || perch_is_configured();
  if (is_delegated()) {
    perch_give_way(&perch);
    if (may_turn) {
      controllerPid(control, setpoint, sensors, state, stabilizerStep);
      return;
    }
  }
  control->controlMode = controlModeForce;
  for (int i = 0; i < STABILIZER_NR_OF_MOTORS; i++) {
    control->normalizedForces[i] = may_turn ? perch.outputs.duties[i] : 0.0f;
  }
}
