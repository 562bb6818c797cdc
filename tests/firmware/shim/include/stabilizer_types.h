/* The parts of the firmware's types that the app uses, under the names that it uses. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

typedef uint32_t stabilizerStep_t;
typedef struct { float x, y, z; } vector_t;
typedef struct { float x, y, z, w; } quaternion_t;
typedef struct { float roll, pitch, yaw; } attitude_t;
typedef struct { vector_t acc, gyro; } sensorData_t;
typedef struct { quaternion_t attitudeQuaternion; vector_t position, velocity; } state_t;

enum { STABILIZER_NR_OF_MOTORS = 4 };
typedef enum { controlModeLegacy = 0, controlModeForceTorque = 1, controlModeForce = 2 } control_mode_t;
typedef struct { float normalizedForces[4]; control_mode_t controlMode; } control_t;

typedef enum { modeDisable = 0, modeAbs, modeVelocity } stab_mode_t;
typedef struct { stab_mode_t x, y, z, roll, pitch, yaw, quat; } setpoint_mode_t;
typedef struct {
  uint32_t timestamp;
  attitude_t attitude, attitudeRate;
  quaternion_t attitudeQuaternion;
  float thrust;
  vector_t position, velocity, acceleration;
  bool velocity_body;
  setpoint_mode_t mode;
} setpoint_t;
