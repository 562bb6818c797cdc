/* The firmware's setpoint in SI and FLU signs: there angles are degrees, and pitch is nose up. */
#include "shell.h"

#define RAD_PER_DEG 0.017453292519943295f

static perch_vector metres(float x, float y, float z) { return (perch_vector){x, y, z}; }

perch_setpoint perch_setpoint_from(const setpoint_t *s, uint32_t now_ms) {
  return (perch_setpoint){
      .mode = {(uint8_t)s->mode.x, (uint8_t)s->mode.y, (uint8_t)s->mode.z},
      .mode_roll = (uint8_t)s->mode.roll,
      .mode_pitch = (uint8_t)s->mode.pitch,
      .mode_yaw = (uint8_t)s->mode.yaw,
      .mode_quaternion = (uint8_t)s->mode.quat,
      .velocity_body = s->velocity_body,
      .position = metres(s->position.x, s->position.y, s->position.z),
      .velocity = metres(s->velocity.x, s->velocity.y, s->velocity.z),
      .acceleration = metres(s->acceleration.x, s->acceleration.y, s->acceleration.z),
      .roll = RAD_PER_DEG * s->attitude.roll,
      .pitch = -RAD_PER_DEG * s->attitude.pitch,
      .yaw = RAD_PER_DEG * s->attitude.yaw,
      .rates = {RAD_PER_DEG * s->attitudeRate.roll, -RAD_PER_DEG * s->attitudeRate.pitch,
                RAD_PER_DEG * s->attitudeRate.yaw},
      .quaternion = {s->attitudeQuaternion.x, s->attitudeQuaternion.y, s->attitudeQuaternion.z,
                     s->attitudeQuaternion.w},
      .thrust = s->thrust,
      .age = 1e-3f * (float)(now_ms - s->timestamp),
  };
}

bool perch_is_level_out(const setpoint_t *s) {
  return s->mode.x == modeDisable && s->mode.y == modeDisable && s->mode.roll == modeAbs &&
         s->mode.pitch == modeAbs && s->mode.yaw == modeVelocity && s->attitude.roll == 0.0f &&
         s->attitude.pitch == 0.0f && s->attitudeRate.yaw == 0.0f;
}
