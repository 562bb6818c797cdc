/* What a task of lower priority asks of the control loop, which may interrupt it anywhere. */
#include <string.h>

#include "core.h"
#include "crc32.h"
#include "order.h"

uint32_t perch_post(perch_core *core, bool armed, const perch_approach *approach) {
  const perch_plan plan = perch_plan_approach(approach);
  const uint32_t number = core->posted + 1u;
  core->posted = core->consumed; /* withdraws one that still waits: nobody takes half of each */
  perch_in_this_order();
  core->request.armed = armed;
  core->request.plan = plan;
  core->outputs.trajectory_status = PERCH_TRAJECTORY_NONE;
  perch_in_this_order();
  core->posted = number;
  return number;
}

bool perch_is_consumed(const perch_core *core, uint32_t number) { return core->consumed == number; }

bool perch_arm_policy(perch_core *core, bool on) {
  core->policy_armed = on && core->policy_is_live;
  return core->policy_armed;
}

void perch_ask_go(perch_core *core, bool on) { core->go = on; }

void perch_ask_abort(perch_core *core, bool on) { core->abort = on; }

void perch_set_ceiling(perch_core *core, float ceiling_z) { core->idle_ceiling_z = ceiling_z; }

/* Check the staged bytes and take them over; nobody writes to them meanwhile. */
static perch_policy_status take_staged(perch_core *core, uint32_t length, uint32_t crc) {
  if (perch_crc32(0, core->staged.bytes, length) != crc) {
    return PERCH_POLICY_REFUSED_CRC;
  }
  perch_policy policy;
  const perch_policy_status status = perch_parse_bundle(&core->staged, length, &policy);
  if (status != PERCH_POLICY_ACTIVE) {
    return status;
  }
  core->policy_is_live = false;
  perch_in_this_order();
  memcpy(core->live.bytes, core->staged.bytes, length);
  policy.bank = &core->live;
  core->policy = policy;
  perch_in_this_order();
  core->policy_is_live = true;
  return PERCH_POLICY_ACTIVE;
}

perch_policy_status perch_commit(perch_core *core, uint32_t length, uint32_t crc, bool flying) {
  if (flying) {
    return PERCH_POLICY_REFUSED_FLYING;
  }
  if (length < 1 || length > PERCH_MAX_BUNDLE) {
    return PERCH_POLICY_REFUSED_LENGTH;
  }
  core->commits = true;
  perch_in_this_order();
  /* A write that has begun is of bytes for which no CRC was given. */
  const perch_policy_status status = core->stages ? PERCH_POLICY_REFUSED_CRC : take_staged(core, length, crc);
  perch_in_this_order();
  core->commits = false;
  return status;
}

uint32_t perch_live_crc(const perch_core *core) { return core->policy_is_live ? core->policy.crc : 0; }
