/* How old the last external pose is: the firmware tells only when it came, in ms modulo 65.5 s. */
#include "log.h"
#include "shell.h"

uint32_t perch_pose_age(uint32_t now_ms) {
  static bool is_heard;
  static uint16_t last;
  static uint32_t heard_at;
  static logVarId_t id = 0xffffu;
  if (!logVarIdIsValid(id)) {
    id = logGetVarId("locSrvZ", "tick");
  }
  const uint16_t tick = logVarIdIsValid(id) ? (uint16_t)logGetUint(id) : last;
  if (tick != last) {
    /* Counted on from here, a pose that is older than a turn of the counter does not look young again. */
    last = tick;
    heard_at = now_ms - (uint16_t)((uint16_t)now_ms - tick);
    is_heard = true;
  }
  return is_heard ? now_ms - heard_at : PERCH_NO_POSE;
}
