"""The landing state machine on the drone: approach, trigger, flip, cut, and what happens when that fails.

::

    IDLE --arm--> TRAJECTORY_ARMED --go--> APPROACH --trigger--> FLIP --b3.z <= 0--> CUT
                                              |
                                              +--missed, abort, bad pose--> BRAKE --> HOLD --> IDLE

Rules (default deny: what is not known is not allowed, and a NaN never starts anything):

- The trajectory is armed apart from the policy, and only while flying, near the start, with sound numbers.
- The policy counts only in APPROACH, only when armed, only in the step in which it was evaluated, and only
  with finite cues of a climbing, upright vehicle. A trigger stores the snapshot.
- The flip ends when b3.z <= 0 (errata 8). The attitude for this is the machine's own: it follows the gyro,
  is pulled slowly towards the estimate before the flip and not at all during it. A single bad pose cannot
  move the cut. A flip that takes too long, or an abort in it, cuts as well.
- A missed trigger brakes: with an armed policy as soon as its next look would find tau below its range (no
  later trigger can come), without one when the stopping distance demands it (:mod:`onboard.landing.braking`).
  Without a policy the ceiling is always avoided. With one, waiting for the trigger takes longer than stopping
  would, above a climb that docs/flying.md gives, and the ceiling is met.
- Contact takes the thrust away as any other brake, and ends none: a drone that is upright and falls is
  caught, one whose motors were cut would fall to the floor. What the ceiling has tipped over by more than
  the tilt's limit is cut.
- HOLD ends when the trajectory is disarmed and the vehicle has slowed down: whoever flies next starts from a
  standstill, and a climb that it would stop at once takes all thrust away.
- Without poses BRAKE and HOLD go on by the estimate, which dead-reckons, until the drone is handed over to be
  landed. Only an estimate that cannot be true (:mod:`onboard.landing.estimate`) ends in FAULT; until then a
  hold is level and carries its weight.
- CUT and FAULT are latched until both arm flags are clear and the drone does not fly.
"""

import math
from typing import Any

import numpy as np

from onboard.app_interface import EndReason, LandingState, TrajectoryStatus
from onboard.jit import inner, outlined
from onboard.landing.attitude import is_finite, own_attitude, propagate_attitude
from onboard.landing.braking import hold_setpoint, stopping_distance
from onboard.landing.estimate import estimate_is_finite, estimate_is_usable, has_pose
from onboard.landing.model import (
    LANDING_MEMORY,
    LandingInputs,
    LandingLimits,
    LandingOutput,
    OutputMode,
    landing_limits,
    new_landing_memory,
)
from onboard.mixer import flip_thrusts
from onboard.rotation import body_z, euler_angles
from onboard.trajectory import ApproachPlan, Setpoint, approach_is_sound, smooth_approach

__all__ = [
    "LANDING_MEMORY",
    "EndReason",
    "LandingInputs",
    "LandingLimits",
    "LandingOutput",
    "LandingState",
    "OutputMode",
    "landing_limits",
    "landing_step",
    "new_landing_memory",
]

IDLE = int(LandingState.IDLE)
TRAJECTORY_ARMED = int(LandingState.TRAJECTORY_ARMED)
APPROACH = int(LandingState.APPROACH)
FLIP = int(LandingState.FLIP)
CUT = int(LandingState.CUT)
BRAKE = int(LandingState.BRAKE)
HOLD = int(LandingState.HOLD)
FAULT = int(LandingState.FAULT)

_PASS = int(OutputMode.PASS)
_SETPOINT = int(OutputMode.SETPOINT)
_LEVEL = int(OutputMode.LEVEL)
_THRUSTS = int(OutputMode.THRUSTS)
_OFF = int(OutputMode.OFF)

_STATUS_NONE = int(TrajectoryStatus.NONE)
_STATUS_ARMED = int(TrajectoryStatus.ARMED)
_STATUS_FLYING = int(TrajectoryStatus.FLYING)
_REFUSED_TOO_FAR = int(TrajectoryStatus.REFUSED_TOO_FAR)
_REFUSED_NUMBERS = int(TrajectoryStatus.REFUSED_NUMBERS)
_REFUSED_NOT_FLYING = int(TrajectoryStatus.REFUSED_NOT_FLYING)

# Not plain integers: as constants in calls each of these would make a compiled function of its own.
_TRIGGERED = np.int64(EndReason.TRIGGERED)
_MISSED_TRIGGER = np.int64(EndReason.MISSED_TRIGGER)
_ABORT = np.int64(EndReason.ABORT)
_DISARMED = np.int64(EndReason.DISARMED)
_BAD_ESTIMATE = np.int64(EndReason.BAD_ESTIMATE)
_OFF_TRACK = np.int64(EndReason.OFF_TRACK)
_TILT = np.int64(EndReason.TILT)
_CONTACT = np.int64(EndReason.CONTACT)
_NOT_FLYING = np.int64(EndReason.NOT_FLYING)
_POSE_LOST = np.int64(EndReason.POSE_LOST)

POLICY_PERIOD = 0.01
"""s. The policy is evaluated at 100 Hz (errata 9)."""

FALL_SPEED = -0.5
"""m/s. A brake has done its work when the vehicle falls this fast."""

HAND_OVER_SPEED = 0.6
"""m/s. Fastest hand-over: above the hold's own descent, caught with 27 deg of tilt."""

HAND_OVER_CLIMB = 0.2
"""m/s. Fastest climb at a hand-over: stopped at once, it leaves half of the weight as thrust."""

HAND_OVER_TIMEOUT = 1.5
"""s. A hold that has not slowed down by then is handed over all the same: somebody wants the drone down."""

_ZERO = (0.0, 0.0, 0.0)
_NO_THRUSTS = (0.0, 0.0, 0.0, 0.0)


@inner
def _end_approach(memory: Any, state: int, reason: np.int64) -> None:
    memory.state = state
    memory.reason = reason
    memory.trajectory_status = _STATUS_NONE


@inner
def _begin_brake(memory: Any, inputs: LandingInputs, reason: np.int64) -> None:
    _end_approach(memory, BRAKE, reason)
    memory.usable_time = inputs.time


@inner
def _start_distance(inputs: LandingInputs, plan: ApproachPlan) -> float:
    """Distance (m) from the plan's start; NaN for a position that is not known."""
    p = inputs.position
    dx, dy, dz = p[0] - plan.x0, p[1] - plan.y0, p[2] - plan.z0
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@inner
def _arm(memory: Any, inputs: LandingInputs, plan: ApproachPlan, limits: LandingLimits) -> None:
    if not inputs.flying:
        memory.trajectory_status = _REFUSED_NOT_FLYING
    elif not approach_is_sound(plan, limits.start_z_min):
        memory.trajectory_status = _REFUSED_NUMBERS
    elif not _start_distance(inputs, plan) <= limits.start_distance:
        memory.trajectory_status = _REFUSED_TOO_FAR
    else:
        memory.trajectory_status = _STATUS_ARMED
        memory.state = TRAJECTORY_ARMED
        memory.reason = 0


@inner
def _may_go(inputs: LandingInputs, plan: ApproachPlan, limits: LandingLimits) -> bool:
    v = inputs.velocity
    speed = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return (
        inputs.flying
        and estimate_is_finite(inputs)
        and has_pose(inputs, limits)
        and _start_distance(inputs, plan) <= limits.start_distance
        and speed <= limits.start_speed
    )


@inner
def _triggers(memory: Any, inputs: LandingInputs) -> bool:
    """Whether the policy fires now. Written so that a NaN anywhere makes it False."""
    return (
        inputs.policy_armed
        and inputs.evaluated
        and inputs.trigger_value >= 0.0
        and inputs.trigger_value < math.inf
        and 0.0 < inputs.tau < math.inf
        and 0.0 < inputs.d_ceil < math.inf
        and math.isfinite(inputs.theta_x)
        and 0.0 < abs(inputs.a_rot) < math.inf
        and inputs.velocity[2] > 0.0
        and is_finite(inputs.gyro)
        and memory.attitude_known == 1
        and body_z(memory.attitude)[2] > 0.5
    )


@inner
def _begin_flip(memory: Any, inputs: LandingInputs) -> None:
    _end_approach(memory, FLIP, _TRIGGERED)
    memory.flip_time = inputs.time
    memory.snapshot_time = inputs.time
    memory.snapshot_tau = inputs.tau
    memory.snapshot_theta_x = inputs.theta_x
    memory.snapshot_d_ceil = inputs.d_ceil
    memory.snapshot_trigger_value = inputs.trigger_value
    memory.snapshot_a_rot = inputs.a_rot
    memory.snapshot_z = inputs.position[2]
    memory.snapshot_pitch = euler_angles(own_attitude(memory))[1]
    for i in range(3):
        memory.snapshot_velocity[i] = inputs.velocity[i]
    memory.snapshot_count += 1  # last: who sees the new count finds the new fields


@inner
def _trigger_is_missed(memory: Any, inputs: LandingInputs, plan: ApproachPlan, limits: LandingLimits) -> bool:
    """Whether to brake now because no trigger can come any more, or because later is too late."""
    climb = inputs.velocity[2]
    if climb <= 0.0:
        return False
    left = plan.ceiling_z - inputs.position[2]
    if inputs.policy_armed and limits.policy_tau_min > 0.0:
        # The policy has just looked, and when it looks again tau will be less by its period.
        last = limits.policy_tau_min + (POLICY_PERIOD if inputs.evaluated else 0.0)
        return left < last * climb
    climbing = inputs.time - memory.start_time < plan.t_x + plan.t_z + 2.0 * limits.smoothing
    acceleration = limits.thrust_reserve + (plan.az if climbing else 0.0)
    rise = stopping_distance(climb, acceleration, limits.motor_lag) + climb * limits.latency
    return left - limits.brake_margin < rise


@inner
def _is_tilted(memory: Any, limits: LandingLimits) -> bool:
    return not body_z(memory.attitude)[2] > math.cos(limits.tilt_limit)


@inner
def _step_approach(memory: Any, inputs: LandingInputs, plan: ApproachPlan, limits: LandingLimits) -> None:
    t = inputs.time - memory.start_time
    if not inputs.flying:
        _end_approach(memory, CUT, _NOT_FLYING)
    elif _is_tilted(memory, limits):
        _end_approach(memory, CUT, _TILT)
    elif inputs.abort:
        _begin_brake(memory, inputs, _ABORT)
    elif not inputs.trajectory_armed:
        _begin_brake(memory, inputs, _DISARMED)
    elif not (estimate_is_finite(inputs) and is_finite(inputs.gyro) and math.isfinite(t)):
        _begin_brake(memory, inputs, _BAD_ESTIMATE)
    elif not has_pose(inputs, limits):
        _begin_brake(memory, inputs, _POSE_LOST)
    elif plan.ceiling_z - inputs.position[2] <= limits.contact_distance:
        _begin_brake(memory, inputs, _CONTACT)
    elif _triggers(memory, inputs):
        _begin_flip(memory, inputs)
    elif _trigger_is_missed(memory, inputs, plan, limits):
        _begin_brake(memory, inputs, _MISSED_TRIGGER)
    elif (
        abs(inputs.position[1] - plan.y0) > limits.lateral_limit or t > plan.t_x + plan.t_z + plan.tau0 + 0.5
    ):
        _begin_brake(memory, inputs, _OFF_TRACK)


@inner
def _step_flip(memory: Any, inputs: LandingInputs, limits: LandingLimits) -> None:
    upright = body_z(memory.attitude)[2] > 0.0
    in_time = inputs.time - memory.flip_time <= limits.flip_timeout
    if inputs.abort or not (upright and in_time and is_finite(inputs.gyro)):
        memory.state = CUT


@inner
def _may_hand_over(memory: Any, inputs: LandingInputs) -> bool:
    v = inputs.velocity
    slow = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] <= HAND_OVER_SPEED * HAND_OVER_SPEED
    return (slow and v[2] <= HAND_OVER_CLIMB) or inputs.time - memory.hold_time > HAND_OVER_TIMEOUT


@inner
def _step_brake(memory: Any, inputs: LandingInputs, plan: ApproachPlan, limits: LandingLimits) -> None:
    """BRAKE and HOLD: cut on tilt, fault without an estimate, hold once the climb has ended."""
    if _is_tilted(memory, limits):
        memory.state = CUT
        return
    if not estimate_is_usable(memory, inputs, plan, limits):
        if not inputs.time - memory.usable_time <= limits.useless_limit:
            memory.state = FAULT
        return
    memory.usable_time = inputs.time
    if memory.state == BRAKE:
        climb = inputs.velocity[2]
        # Low enough, it can stop in a controlled way at once (0.15 s for the controller to react).
        apex = inputs.position[2] + climb * (0.15 + 0.5 * climb / limits.hold_acceleration)
        if climb <= FALL_SPEED or (climb > 0.0 and apex <= plan.ceiling_z - limits.hold_clearance):
            memory.state = HOLD
            memory.hold_time = inputs.time
            for i in range(3):
                memory.hold_position[i] = inputs.position[i]
                memory.hold_velocity[i] = inputs.velocity[i]
    elif not inputs.trajectory_armed and _may_hand_over(memory, inputs):
        memory.state = IDLE


@inner
def _advance(memory: Any, inputs: LandingInputs, plan: ApproachPlan, limits: LandingLimits) -> None:
    state = memory.state
    if state == IDLE:
        if inputs.trajectory_armed and memory.arm_seen == 0 and not inputs.abort:
            _arm(memory, inputs, plan, limits)
    elif state == TRAJECTORY_ARMED:
        if inputs.abort or not inputs.trajectory_armed or not inputs.flying:
            memory.state = IDLE
            memory.trajectory_status = _STATUS_NONE
            memory.reason = _ABORT if inputs.abort else _DISARMED
        elif inputs.go and memory.go_seen == 0 and _may_go(inputs, plan, limits):
            memory.state = APPROACH
            memory.trajectory_status = _STATUS_FLYING
            memory.start_time = inputs.time
    elif state == APPROACH:
        _step_approach(memory, inputs, plan, limits)
    elif state == FLIP:
        _step_flip(memory, inputs, limits)
    elif state in (BRAKE, HOLD):
        _step_brake(memory, inputs, plan, limits)
    elif not (inputs.trajectory_armed or inputs.policy_armed or inputs.flying):
        memory.state = IDLE
    memory.arm_seen = 1 if inputs.trajectory_armed else 0
    memory.go_seen = 1 if inputs.go else 0


@inner
def _approach_setpoint(elapsed: float, plan: ApproachPlan, limits: LandingLimits) -> Setpoint:
    """The approach as motors with a lag can fly it: rounded off, its thrust commanded ahead by the lag."""
    p, v, a, jerk = smooth_approach(plan, elapsed - limits.smoothing, limits.smoothing)
    lag = limits.motor_lag_up if jerk[2] > 0.0 else limits.motor_lag
    return p, v, (a[0], a[1], a[2] + lag * jerk[2])


@inner
def _output(memory: Any, inputs: LandingInputs, plan: ApproachPlan, limits: LandingLimits) -> LandingOutput:
    state = memory.state
    attitude = own_attitude(memory)
    if state == APPROACH:
        p, v, a = _approach_setpoint(inputs.time - memory.start_time, plan, limits)
        return LandingOutput(_SETPOINT, p, v, a, 0.0, 0.0, _NO_THRUSTS, attitude)
    if state == HOLD and memory.usable_time != inputs.time:
        return LandingOutput(_LEVEL, _ZERO, _ZERO, _ZERO, 0.0, limits.weight, _NO_THRUSTS, attitude)
    if state == HOLD:
        p, v, a = hold_setpoint(memory, inputs.time, plan, limits)
        return LandingOutput(_SETPOINT, p, v, a, 0.0, 0.0, _NO_THRUSTS, attitude)
    if state == BRAKE:
        return LandingOutput(_LEVEL, _ZERO, _ZERO, _ZERO, 0.0, 0.0, _NO_THRUSTS, attitude)
    if state == FLIP:
        m1, m2, m3, m4 = flip_thrusts(memory.snapshot_a_rot, limits.arm_x)
        most = limits.thrust_max
        thrusts = (min(m1, most), min(m2, most), min(m3, most), min(m4, most))
        return LandingOutput(_THRUSTS, _ZERO, _ZERO, _ZERO, 0.0, 0.0, thrusts, attitude)
    if state in (CUT, FAULT):
        return LandingOutput(_OFF, _ZERO, _ZERO, _ZERO, 0.0, 0.0, _NO_THRUSTS, attitude)
    return LandingOutput(_PASS, _ZERO, _ZERO, _ZERO, 0.0, 0.0, _NO_THRUSTS, attitude)


@outlined
def landing_step(
    memory: Any, inputs: LandingInputs, plan: ApproachPlan, limits: LandingLimits
) -> LandingOutput:
    """One step of the machine, at the rate of the controller (500 Hz or 1 kHz).

    Args:
        memory: record of `LANDING_MEMORY` (:func:`new_landing_memory`), changed in place.
        inputs: this step's sample.
        plan: the approach; must not change while the trajectory is armed.
        limits: the limits (:func:`landing_limits`).

    Returns:
        What the drone has to do now. The result depends on the arguments and on nothing else.
    """
    propagate_attitude(memory, inputs)
    _advance(memory, inputs, plan, limits)
    return _output(memory, inputs, plan, limits)
