/* Parameter group `perch` (onboard/app_interface.py), and what its writes ask of the core.
 *
 * Callbacks run in the firmware's parameter task, after the echo has left; packets for that task wait for them. */
#include "param.h"

#include "FreeRTOS.h"
#include "bench_motors.h"
#include "desk.h"
#include "shell.h"
#include "supervisor.h"
#include "task.h"

enum { REQUEST_TIMEOUT_MS = 20, ENGINE_C = 1 };

perch_parameters perch_ground = {.version = PERCH_INTERFACE_VERSION, .engine = ENGINE_C};

static void on_commit(void) {
  perch_parameters *g = &perch_ground;
  g->policy_commit = 0;
  g->policy_status =
      (uint8_t)perch_commit(&perch, g->policy_length, g->policy_crc, supervisorIsFlying());
  g->policy_active_crc = perch_live_crc(&perch);
}

static void on_policy_arm(void) {
  perch_ground.policy_arm = perch_arm_policy(&perch, perch_ground.policy_arm != 0);
}

/* Post the request, and wait until the control loop has it: the host's next question waits behind. */
static void on_trajectory_arm(void) {
  const perch_parameters *g = &perch_ground;
  const perch_approach approach = {
      .vx = g->vx, .vz = g->vz, .impact_x = g->impact_x, .impact_y = g->impact_y,
      .ceiling_z = g->ceiling_z, .ax = g->ax, .az = g->az, .tau0 = g->tau0,
  };
  const uint32_t number = perch_post(&perch, g->trajectory_arm != 0, &approach);
  for (int ms = 0; ms < REQUEST_TIMEOUT_MS && !perch_is_consumed(&perch, number); ms++) {
    vTaskDelay(M2T(1));
  }
}

static void on_go(void) { perch_ask_go(&perch, perch_ground.go != 0); }

static void on_abort(void) { perch_ask_abort(&perch, perch_ground.abort != 0); }

static void on_ceiling(void) { perch_set_ceiling(&perch, perch_ground.ceiling_z); }

static void on_motor_token(void) { perch_vouch(); }

static void on_rehearse(void) {
  const uint8_t wanted = perch_ground.rehearse;
  perch_switch_rehearsal(wanted);
  perch_ground.rehearse = wanted; /* the end of another one may have cleared it */
  if (!perch_is_on_the_desk()) {
    perch_ground.rehearse = 0;
  }
}

void perch_answer_ground(uint8_t events) {
  if (events & PERCH_REFUSED) {
    perch_ground.trajectory_arm = 0;
  }
  if (events & PERCH_GO_TAKEN) {
    perch_ground.go = 0;
  }
  if (events & PERCH_ABORT_TAKEN) {
    perch_ground.abort = 0;
  }
  if (events & PERCH_REHEARSAL_ENDED) {
    perch_note_rehearsal_ended();
    perch_ground.rehearse = perch_ground.trajectory_arm = perch_ground.policy_arm = 0;
    perch_ground.go = perch_ground.abort = 0;
  }
}

PARAM_GROUP_START(perch)
PARAM_ADD(PARAM_UINT16, polLen, &perch_ground.policy_length)
PARAM_ADD(PARAM_UINT32, polCrc, &perch_ground.policy_crc)
PARAM_ADD_WITH_CALLBACK(PARAM_UINT8, polCommit, &perch_ground.policy_commit, &on_commit)
PARAM_ADD(PARAM_UINT8 | PARAM_RONLY, polStat, &perch_ground.policy_status)
PARAM_ADD(PARAM_UINT32 | PARAM_RONLY, polActCrc, &perch_ground.policy_active_crc)
PARAM_ADD_WITH_CALLBACK(PARAM_UINT8, polArm, &perch_ground.policy_arm, &on_policy_arm)
PARAM_ADD_WITH_CALLBACK(PARAM_UINT8, trjArm, &perch_ground.trajectory_arm, &on_trajectory_arm)
PARAM_ADD(PARAM_UINT8 | PARAM_RONLY, trjStat, &perch.outputs.trajectory_status)
PARAM_ADD_WITH_CALLBACK(PARAM_UINT8, go, &perch_ground.go, &on_go)
PARAM_ADD_WITH_CALLBACK(PARAM_UINT8, abort, &perch_ground.abort, &on_abort)
PARAM_ADD_WITH_CALLBACK(PARAM_FLOAT, zCeil, &perch_ground.ceiling_z, &on_ceiling)
PARAM_ADD(PARAM_FLOAT, xImp, &perch_ground.impact_x)
PARAM_ADD(PARAM_FLOAT, yImp, &perch_ground.impact_y)
PARAM_ADD(PARAM_FLOAT, vx, &perch_ground.vx)
PARAM_ADD(PARAM_FLOAT, vz, &perch_ground.vz)
PARAM_ADD(PARAM_FLOAT, ax, &perch_ground.ax)
PARAM_ADD(PARAM_FLOAT, az, &perch_ground.az)
PARAM_ADD(PARAM_FLOAT, tau0, &perch_ground.tau0)
PARAM_ADD(PARAM_UINT8 | PARAM_RONLY, state, &perch.outputs.state)
PARAM_ADD(PARAM_UINT32 | PARAM_RONLY, vehCrc, &perch_ground.vehicle_crc)
PARAM_ADD(PARAM_UINT8 | PARAM_RONLY, version, &perch_ground.version)
PARAM_ADD(PARAM_UINT8 | PARAM_RONLY, engine, &perch_ground.engine)
PARAM_ADD(PARAM_UINT8, ownLaw, &perch_ground.own_law)
PARAM_ADD_WITH_CALLBACK(PARAM_UINT8, motTok, &perch_ground.motor_token, &on_motor_token)
PARAM_ADD_WITH_CALLBACK(PARAM_UINT8, rehearse, &perch_ground.rehearse, &on_rehearse)
PARAM_GROUP_STOP(perch)
