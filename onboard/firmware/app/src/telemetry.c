/* Log groups `perch` (now), `perchT` (at the trigger) and `perchM` (the model) of onboard/app_interface.py.
 *
 * The log task is not atomic with the control loop: the snapshot's count is written last, and a host believes two
 * blocks only when they have the same one. */
#include "log.h"
#include "shell.h"

static uint32_t trigger_tick(uint32_t timestamp, void *data) {
  (void)timestamp;
  (void)data;
  return perch_trigger_ms();
}

static logByFunction_t trigger = {.acquireUInt32 = trigger_tick, .data = NULL};

LOG_GROUP_START(perch)
LOG_ADD(LOG_UINT8, state, &perch.outputs.state)
LOG_ADD(LOG_UINT8, reason, &perch.outputs.reason)
LOG_ADD(LOG_FLOAT, tau, &perch.outputs.policy.cues.tau)
LOG_ADD(LOG_FLOAT, thetaX, &perch.outputs.policy.cues.theta_x)
LOG_ADD(LOG_FLOAT, dCeil, &perch.outputs.policy.cues.d_ceil)
LOG_ADD(LOG_FLOAT, trigVal, &perch.outputs.policy.trigger_value)
LOG_ADD(LOG_FLOAT, aRot, &perch.outputs.policy.a_rot)
LOG_ADD(LOG_UINT32, polCrc, &perch_ground.policy_active_crc)
LOG_ADD(LOG_UINT8, polStat, &perch_ground.policy_status)
LOG_ADD(LOG_UINT16, m1, &perch.outputs.mean_ratios[0])
LOG_ADD(LOG_UINT16, m2, &perch.outputs.mean_ratios[1])
LOG_ADD(LOG_UINT16, m3, &perch.outputs.mean_ratios[2])
LOG_ADD(LOG_UINT16, m4, &perch.outputs.mean_ratios[3])
LOG_GROUP_STOP(perch)

LOG_GROUP_START(perchT)
LOG_ADD_BY_FUNCTION(LOG_UINT32, tick, &trigger)
LOG_ADD(LOG_FLOAT, tau, &perch.landing.snapshot.cues.tau)
LOG_ADD(LOG_FLOAT, thetaX, &perch.landing.snapshot.cues.theta_x)
LOG_ADD(LOG_FLOAT, dCeil, &perch.landing.snapshot.cues.d_ceil)
LOG_ADD(LOG_FLOAT, trigVal, &perch.landing.snapshot.trigger_value)
LOG_ADD(LOG_FLOAT, aRot, &perch.landing.snapshot.a_rot)
LOG_ADD(LOG_FLOAT, vx, &perch.landing.snapshot.velocity.x)
LOG_ADD(LOG_FLOAT, vy, &perch.landing.snapshot.velocity.y)
LOG_ADD(LOG_FLOAT, vz, &perch.landing.snapshot.velocity.z)
LOG_ADD(LOG_FLOAT, z, &perch.landing.snapshot.z)
LOG_ADD(LOG_FLOAT, pitch, &perch.landing.snapshot.pitch)
LOG_ADD(LOG_UINT8, count, &perch.landing.snapshot.count)
LOG_GROUP_STOP(perchT)

LOG_GROUP_START(perchM)
LOG_ADD(LOG_FLOAT, x, &perch.model.estimate.position.x)
LOG_ADD(LOG_FLOAT, y, &perch.model.estimate.position.y)
LOG_ADD(LOG_FLOAT, z, &perch.model.estimate.position.z)
LOG_ADD(LOG_FLOAT, vx, &perch.model.estimate.velocity.x)
LOG_ADD(LOG_FLOAT, vy, &perch.model.estimate.velocity.y)
LOG_ADD(LOG_FLOAT, vz, &perch.model.estimate.velocity.z)
LOG_GROUP_STOP(perchM)
