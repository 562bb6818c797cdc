#include "landing.h"

#include <stdatomic.h>

#include "mixer.h"
#include "rotation.h"

#define POLICY_PERIOD 0.01f     /* s */
#define FALL_SPEED (-0.5f)      /* m/s: a brake has done its work when the vehicle falls this fast */
#define HAND_OVER_SPEED 0.6f    /* m/s: fastest hand-over, above the hold's own descent */
#define HAND_OVER_CLIMB 0.2f    /* m/s: stopped at once, a faster climb takes all thrust away */
#define HAND_OVER_TIMEOUT 1.5f  /* s: handed over all the same, for somebody wants the drone down */
#define REACTION 0.15f          /* s until the controller brakes with all its acceleration */
#define LATEST_IMPACT 0.5f      /* s after which an approach that has met nothing is off its track */

static void end_approach(perch_landing_memory *memory, perch_state state, perch_reason reason) {
  memory->state = (uint8_t)state;
  memory->reason = (uint8_t)reason;
  memory->trajectory_status = PERCH_TRAJECTORY_NONE;
}

static void begin_brake(perch_landing_memory *memory, const perch_landing_inputs *in, perch_reason reason) {
  end_approach(memory, PERCH_BRAKE, reason);
  memory->usable_tick = in->tick;
}

static float start_distance(const perch_landing_inputs *in, const perch_plan *plan) {
  const perch_vector start = {plan->x0, plan->y0, plan->z0};
  return perch_distance(&in->position, &start);
}

static void arm(perch_landing_memory *memory, const perch_landing_inputs *in, const perch_plan *plan,
                const perch_vehicle *vehicle) {
  if (!in->flying) {
    memory->trajectory_status = PERCH_TRAJECTORY_REFUSED_NOT_FLYING;
  } else if (!perch_approach_is_sound(plan, vehicle->limit_start_z_min)) {
    memory->trajectory_status = PERCH_TRAJECTORY_REFUSED_NUMBERS;
  } else if (!(start_distance(in, plan) <= vehicle->limit_start_distance)) {
    memory->trajectory_status = PERCH_TRAJECTORY_REFUSED_TOO_FAR;
  } else {
    memory->trajectory_status = PERCH_TRAJECTORY_ARMED_STATUS;
    memory->state = PERCH_TRAJECTORY_ARMED;
    memory->reason = PERCH_REASON_NONE;
  }
}

static bool may_go(const perch_landing_inputs *in, const perch_plan *plan, const perch_vehicle *vehicle) {
  return in->flying && perch_estimate_is_finite(in) && perch_has_pose(in, vehicle) &&
         start_distance(in, plan) <= vehicle->limit_start_distance &&
         perch_norm(&in->velocity) <= vehicle->limit_start_speed;
}

/* Whether the policy fires now. Written so that a NaN anywhere makes it false. */
static bool triggers(const perch_landing_memory *memory, const perch_landing_inputs *in) {
  return in->policy_armed && in->evaluated && in->trigger_value >= 0.0f && in->trigger_value < INFINITY &&
         in->cues.tau > 0.0f && in->cues.tau < INFINITY && in->cues.d_ceil > 0.0f &&
         in->cues.d_ceil < INFINITY && isfinite(in->cues.theta_x) && fabsf(in->a_rot) > 0.0f &&
         fabsf(in->a_rot) < INFINITY && in->velocity.z > 0.0f && perch_is_finite(&in->gyro) &&
         memory->attitude_known && perch_body_z(&memory->attitude).z > 0.5f;
}

static void begin_flip(perch_landing_memory *memory, const perch_landing_inputs *in) {
  perch_snapshot *snapshot = &memory->snapshot;
  end_approach(memory, PERCH_FLIP, PERCH_REASON_TRIGGERED);
  memory->flip_tick = in->tick;
  snapshot->tick = in->tick;
  snapshot->cues = in->cues;
  snapshot->trigger_value = in->trigger_value;
  snapshot->a_rot = in->a_rot;
  snapshot->velocity = in->velocity;
  snapshot->z = in->position.z;
  snapshot->pitch = perch_euler_angles(&memory->attitude).y;
  atomic_signal_fence(memory_order_release); /* the log task may read in between */
  snapshot->count++;
}

/* Whether to brake now because no trigger can come any more, or because later is too late. */
static bool trigger_is_missed(const perch_landing_memory *memory, const perch_landing_inputs *in,
                              const perch_plan *plan, const perch_vehicle *vehicle) {
  const float climb = in->velocity.z;
  if (climb <= 0.0f) {
    return false;
  }
  const float left = plan->ceiling_z - in->position.z;
  if (in->policy_armed && in->policy_tau_min > 0.0f) {
    /* The policy has just looked, and when it looks again tau will be less by its period. */
    return left < (in->policy_tau_min + (in->evaluated ? POLICY_PERIOD : 0.0f)) * climb;
  }
  const float t = perch_seconds(in->tick - memory->start_tick);
  const bool climbing = t < plan->t_x + plan->t_z + 2.0f * vehicle->limit_smoothing;
  const float acceleration = vehicle->limit_thrust_reserve + (climbing ? plan->az : 0.0f);
  const float rise = perch_stopping_distance(climb, acceleration, vehicle->limit_motor_lag);
  return left - vehicle->limit_brake_margin < rise + climb * vehicle->limit_latency;
}

static bool is_tilted(const perch_landing_memory *memory, const perch_vehicle *vehicle) {
  return !(perch_body_z(&memory->attitude).z > cosf(vehicle->limit_tilt_limit));
}

static bool is_off_track(const perch_landing_memory *memory, const perch_landing_inputs *in,
                         const perch_plan *plan, const perch_vehicle *vehicle) {
  return fabsf(in->position.y - plan->y0) > vehicle->limit_lateral_limit ||
         perch_seconds(in->tick - memory->start_tick) > plan->t_x + plan->t_z + plan->tau0 + LATEST_IMPACT;
}

static void step_approach(perch_landing_memory *memory, const perch_landing_inputs *in, const perch_plan *plan,
                          const perch_vehicle *vehicle) {
  if (!in->flying) {
    end_approach(memory, PERCH_CUT, PERCH_REASON_NOT_FLYING);
  } else if (is_tilted(memory, vehicle)) {
    end_approach(memory, PERCH_CUT, PERCH_REASON_TILT);
  } else if (in->abort) {
    begin_brake(memory, in, PERCH_REASON_ABORT);
  } else if (!in->trajectory_armed) {
    begin_brake(memory, in, PERCH_REASON_DISARMED);
  } else if (!(perch_estimate_is_finite(in) && perch_is_finite(&in->gyro))) {
    begin_brake(memory, in, PERCH_REASON_BAD_ESTIMATE);
  } else if (!perch_has_pose(in, vehicle)) {
    begin_brake(memory, in, PERCH_REASON_POSE_LOST);
  } else if (plan->ceiling_z - in->position.z <= vehicle->limit_contact_distance) {
    begin_brake(memory, in, PERCH_REASON_CONTACT);
  } else if (triggers(memory, in)) {
    begin_flip(memory, in);
  } else if (trigger_is_missed(memory, in, plan, vehicle)) {
    begin_brake(memory, in, PERCH_REASON_MISSED_TRIGGER);
  } else if (is_off_track(memory, in, plan, vehicle)) {
    begin_brake(memory, in, PERCH_REASON_OFF_TRACK);
  }
}

static void step_flip(perch_landing_memory *memory, const perch_landing_inputs *in,
                      const perch_vehicle *vehicle) {
  const bool upright = perch_body_z(&memory->attitude).z > 0.0f;
  const bool in_time = perch_seconds(in->tick - memory->flip_tick) <= vehicle->limit_flip_timeout;
  if (in->abort || !(upright && in_time && perch_is_finite(&in->gyro))) {
    memory->state = PERCH_CUT;
  }
}

static bool may_hand_over(const perch_landing_memory *memory, const perch_landing_inputs *in) {
  const bool slow = perch_dot(&in->velocity, &in->velocity) <= HAND_OVER_SPEED * HAND_OVER_SPEED;
  return (slow && in->velocity.z <= HAND_OVER_CLIMB) ||
         perch_seconds(in->tick - memory->hold_tick) > HAND_OVER_TIMEOUT;
}

/* Whether a braking vehicle falls, or is low enough to stop in a controlled way at once. */
static bool may_hold(const perch_landing_inputs *in, const perch_plan *plan, const perch_vehicle *vehicle) {
  const float climb = in->velocity.z;
  const float apex = in->position.z + climb * (REACTION + 0.5f * climb / vehicle->limit_hold_acceleration);
  return climb <= FALL_SPEED || (climb > 0.0f && apex <= plan->ceiling_z - vehicle->limit_hold_clearance);
}

/* BRAKE and HOLD: cut on tilt, fault without an estimate, hold once the climb has ended. */
static void step_brake(perch_landing_memory *memory, const perch_landing_inputs *in, const perch_plan *plan,
                       const perch_vehicle *vehicle) {
  if (is_tilted(memory, vehicle)) {
    memory->state = PERCH_CUT;
    return;
  }
  if (!perch_estimate_is_usable(memory, in, plan, vehicle)) {
    if (perch_seconds(in->tick - memory->usable_tick) > vehicle->limit_useless_limit) {
      memory->state = PERCH_FAULT;
    }
    return;
  }
  memory->usable_tick = in->tick;
  if (memory->state == PERCH_HOLD) {
    if (!in->trajectory_armed && may_hand_over(memory, in)) {
      memory->state = PERCH_IDLE;
    }
  } else if (may_hold(in, plan, vehicle)) {
    memory->state = PERCH_HOLD;
    memory->hold_tick = in->tick;
    memory->hold_position = in->position;
    memory->hold_velocity = in->velocity;
  }
}

static void step_armed(perch_landing_memory *memory, const perch_landing_inputs *in, const perch_plan *plan,
                       const perch_vehicle *vehicle) {
  if (in->abort || !in->trajectory_armed || !in->flying) {
    end_approach(memory, PERCH_IDLE, in->abort ? PERCH_REASON_ABORT : PERCH_REASON_DISARMED);
  } else if (in->go && !memory->go_seen && may_go(in, plan, vehicle)) {
    memory->state = PERCH_APPROACH;
    memory->trajectory_status = PERCH_TRAJECTORY_FLYING;
    memory->start_tick = in->tick;
  }
}

static void advance(perch_landing_memory *memory, const perch_landing_inputs *in, const perch_plan *plan,
                    const perch_vehicle *vehicle) {
  switch ((perch_state)memory->state) {
    case PERCH_IDLE:
      if (in->trajectory_armed && !memory->arm_seen && !in->abort) {
        arm(memory, in, plan, vehicle);
      }
      break;
    case PERCH_TRAJECTORY_ARMED:
      step_armed(memory, in, plan, vehicle);
      break;
    case PERCH_APPROACH:
      step_approach(memory, in, plan, vehicle);
      break;
    case PERCH_FLIP:
      step_flip(memory, in, vehicle);
      break;
    case PERCH_BRAKE:
    case PERCH_HOLD:
      step_brake(memory, in, plan, vehicle);
      break;
    case PERCH_CUT:
    case PERCH_FAULT: /* latched until both switches are off and the drone does not fly */
      if (!(in->trajectory_armed || in->policy_armed || in->flying)) {
        memory->state = PERCH_IDLE;
      }
      break;
  }
  memory->arm_seen = in->trajectory_armed;
  memory->go_seen = in->go;
}

/* The approach as motors with a lag can fly it: rounded off, its thrust commanded ahead by the lag. */
static perch_motion approach_motion(const perch_landing_memory *memory, uint32_t tick, const perch_plan *plan,
                                    const perch_vehicle *vehicle) {
  const float smoothing = vehicle->limit_smoothing;
  const float elapsed = perch_seconds(tick - memory->start_tick);
  float jerk = 0.0f;
  perch_motion motion = perch_smooth_approach(plan, elapsed - smoothing, smoothing, &jerk);
  motion.acceleration.z += jerk * (jerk > 0.0f ? vehicle->limit_motor_lag_up : vehicle->limit_motor_lag);
  return motion;
}

perch_landing_output perch_landing_step(perch_landing_memory *memory, const perch_landing_inputs *in,
                                        const perch_plan *plan, const perch_vehicle *vehicle) {
  perch_landing_output out = {.mode = PERCH_PASS};
  perch_propagate_attitude(memory, in);
  advance(memory, in, plan, vehicle);
  switch ((perch_state)memory->state) {
    case PERCH_IDLE:
    case PERCH_TRAJECTORY_ARMED:
      break;
    case PERCH_APPROACH:
      out.mode = PERCH_SETPOINT;
      out.motion = approach_motion(memory, in->tick, plan, vehicle);
      break;
    case PERCH_FLIP:
      out.mode = PERCH_THRUSTS;
      perch_flip_thrusts(memory->snapshot.a_rot, vehicle, out.thrusts);
      break;
    case PERCH_BRAKE:
      out.mode = PERCH_LEVEL;
      break;
    case PERCH_HOLD:
      if (memory->usable_tick == in->tick) {
        out.mode = PERCH_SETPOINT;
        out.motion = perch_hold_motion(memory, in->tick, plan, vehicle);
      } else { /* blind: level, carrying its weight */
        out.mode = PERCH_LEVEL;
        out.collective = vehicle->mass * PERCH_GRAVITY;
      }
      break;
    case PERCH_CUT:
    case PERCH_FAULT:
      out.mode = PERCH_OFF;
      break;
  }
  return out;
}
