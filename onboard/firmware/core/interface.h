/* What the ground and the drone call things: numbers of onboard/app_interface.py and of the policy bundle. */
#ifndef PERCH_INTERFACE_H
#define PERCH_INTERFACE_H

/* Of the parameters, logs and memory. */
#define PERCH_INTERFACE_VERSION 2

/* Support vectors of a policy: what the 1 kHz loop has time for (docs/policy_bundle.md). */
#define PERCH_MAX_VECTORS 250
#define PERCH_MAX_LAYERS 8
#define PERCH_MAX_WIDTH 32
/* Bytes of a bundle: 250 vectors and 258 numbers of the network. */
#define PERCH_MAX_BUNDLE 5120

typedef enum {
  PERCH_POLICY_NONE = 0,
  PERCH_POLICY_ACTIVE = 1,
  PERCH_POLICY_REFUSED_LENGTH = 16,
  PERCH_POLICY_REFUSED_CRC = 17,
  PERCH_POLICY_REFUSED_FORMAT = 18,
  PERCH_POLICY_REFUSED_RANGE = 19,
  PERCH_POLICY_REFUSED_FLYING = 20,
  PERCH_POLICY_REFUSED_VECTORS = 21,
} perch_policy_status;

typedef enum {
  PERCH_TRAJECTORY_NONE = 0,
  PERCH_TRAJECTORY_ARMED_STATUS = 1,
  PERCH_TRAJECTORY_FLYING = 2,
  PERCH_TRAJECTORY_REFUSED_TOO_FAR = 16,
  PERCH_TRAJECTORY_REFUSED_NUMBERS = 17,
  PERCH_TRAJECTORY_REFUSED_NOT_FLYING = 18,
} perch_trajectory_status;

/* Where a drone that rehearses believes to be. */
typedef enum {
  PERCH_NO_REHEARSAL = 0,
  PERCH_ON_POSES = 1, /* where the ground's poses say */
  PERCH_ON_MODEL = 2, /* where its own model of the vehicle flies */
} perch_rehearsal;

typedef enum {
  PERCH_IDLE = 0,
  PERCH_TRAJECTORY_ARMED = 1,
  PERCH_APPROACH = 2,
  PERCH_FLIP = 3,
  PERCH_CUT = 4,
  PERCH_BRAKE = 5,
  PERCH_HOLD = 6,
  PERCH_FAULT = 7,
} perch_state;

typedef enum {
  PERCH_REASON_NONE = 0,
  PERCH_REASON_TRIGGERED = 1,
  PERCH_REASON_MISSED_TRIGGER = 2,
  PERCH_REASON_ABORT = 3,
  PERCH_REASON_DISARMED = 4,
  PERCH_REASON_BAD_ESTIMATE = 5,
  PERCH_REASON_OFF_TRACK = 6,
  PERCH_REASON_TILT = 7,
  PERCH_REASON_CONTACT = 8,
  PERCH_REASON_NOT_FLYING = 9,
  PERCH_REASON_POSE_LOST = 10,
} perch_reason;

#endif
