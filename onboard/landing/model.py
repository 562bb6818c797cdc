"""What goes into the landing state machine, what comes out, and what it remembers.

The machine itself is :func:`onboard.landing.landing_step`.
"""

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from onboard.arrays import Quaternion, Vector
from onboard.gravity import GRAVITY
from onboard.vehicle.model import Vehicle


class OutputMode(IntEnum):
    """What the drone has to do in this step."""

    PASS = 0
    """The machine does not fly: whoever flew before (the high-level commander) goes on."""
    SETPOINT = 1
    """Track position, velocity, acceleration and yaw of the output with the geometric controller."""
    LEVEL = 2
    """Hold `attitude` level at the output's yaw with `collective` (attitude control alone)."""
    THRUSTS = 3
    """Give the motors the output's thrusts, past controller and mixer."""
    OFF = 4
    """Stop the motors, whatever anybody else asks for."""


class LandingInputs(NamedTuple):
    """One sample for the machine. Plain floats and bools only: other types would be compiled anew.

    Attributes:
        time: s, monotonic. dt: s since the last step.
        position, velocity: m, m/s, estimate, world frame.
        quaternion: attitude estimate, body to world.
        gyro: rad/s, body frame, FLU.
        pose_age: s since the last external pose.
        tau, theta_x, d_ceil: cues of the last evaluation, s, rad/s, m.
        evaluated: whether the policy was evaluated in this very step (100 Hz).
        trigger_value: value of the trigger policy; >= 0 means flip.
        a_rot: N m, output of the action policy.
        policy_armed, trajectory_armed, go, abort: what the ground asks for (levels; `go` and
            `trajectory_armed` act on their rising edge).
        flying: whether the drone's supervisor says that it flies.
    """

    time: float
    dt: float
    position: Vector
    velocity: Vector
    quaternion: Quaternion
    gyro: Vector
    pose_age: float
    tau: float
    theta_x: float
    d_ceil: float
    evaluated: bool
    trigger_value: float
    a_rot: float
    policy_armed: bool
    trajectory_armed: bool
    go: bool
    abort: bool
    flying: bool


class LandingOutput(NamedTuple):
    """What the drone has to do. Which fields matter depends on `mode`.

    Attributes:
        mode: an `OutputMode`.
        position, velocity, acceleration: setpoint, world frame, m, m/s, m/s2.
        yaw: rad.
        collective: N.
        thrusts: N, M1 to M4.
        attitude: the machine's own attitude, propagated from the gyro.
    """

    mode: int
    position: Vector
    velocity: Vector
    acceleration: Vector
    yaw: float
    collective: float
    thrusts: Quaternion
    attitude: Quaternion


class LandingLimits(NamedTuple):
    """Limits of the machine. Lengths in m, times in s, angles in rad.

    Attributes:
        arm_x: m, for the thrusts of the flip. thrust_max: N per motor. weight: N.
        policy_tau_min: below this tau the live policy cannot trigger; NaN when there is none.
        start_distance, start_speed: how near the start the drone must be for `go`.
        start_z_min: lowest start of an approach.
        motor_lag, motor_lag_up: time constants of falling and rising thrust.
        smoothing: half the time over which steps of the approach's acceleration are rounded off.
        latency: from the ceiling's approach to a changed motor command.
        thrust_reserve: m/s2 by which the thrust may exceed what the plan asks for.
        brake_margin: distance from the origin to the ceiling that a brake must leave.
        contact_distance: distance from the origin to the ceiling that counts as contact.
        tilt_limit: largest angle of b3 from vertical outside the flip.
        flip_timeout: longest flip.
        pose_age_limit: oldest pose in an approach.
        speed_limit: fastest estimate that is believed while braking and holding, m/s.
        hold_distance: farthest from its setpoint that an estimate without poses is believed in a hold.
        useless_limit: longest time without a usable estimate while braking and holding.
        lateral_limit: largest distance from the plan in y.
        hold_clearance: distance below the ceiling of the hold after a brake.
        hold_acceleration: m/s2 used to stop. descent_speed: m/s.
    """

    arm_x: float
    thrust_max: float
    weight: float
    policy_tau_min: float
    start_distance: float
    start_speed: float
    start_z_min: float
    motor_lag: float
    motor_lag_up: float
    smoothing: float
    latency: float
    thrust_reserve: float
    brake_margin: float
    contact_distance: float
    tilt_limit: float
    flip_timeout: float
    pose_age_limit: float
    speed_limit: float
    hold_distance: float
    useless_limit: float
    lateral_limit: float
    hold_clearance: float
    hold_acceleration: float
    descent_speed: float


def landing_limits(vehicle: Vehicle, policy_tau_min: float = math.nan) -> LandingLimits:
    """The limits for a vehicle and the live policy's `tau_min` (s; NaN without a policy).

    The flip of the authors' flights took 0.196 to 0.275 s, so 0.5 s is no flip any more. The fastest approach
    flies 3.5 m/s, and the firmware's filter resets itself at 10: 5 m/s is neither. An estimate in a blind
    hold was at most 0.26 m from its setpoint (15 simulated brakes from 1.5 to 3.5 m/s,
    ``benchmarks/dead_reckoning.py``); that of a filter that resets itself in flight jumps farther than 1 m.
    """
    body, motors = vehicle.body, vehicle.motors
    top = max(body.body_top_z.value, body.propeller_height_z.value)
    return LandingLimits(
        arm_x=body.arm_x.value,
        thrust_max=motors.thrust_max.value,
        weight=body.mass.value * GRAVITY,
        policy_tau_min=policy_tau_min,
        start_distance=0.25,
        start_speed=0.3,
        start_z_min=0.2,
        motor_lag=motors.time_constant_down.value,
        motor_lag_up=motors.time_constant_up.value,
        smoothing=0.08,
        latency=0.02,
        thrust_reserve=0.5,
        brake_margin=top + 0.06,
        contact_distance=top + 0.01,
        tilt_limit=math.radians(70.0),
        flip_timeout=0.5,
        pose_age_limit=0.15,
        speed_limit=5.0,
        hold_distance=1.0,
        useless_limit=0.5,
        lateral_limit=0.5,
        hold_clearance=0.7,
        hold_acceleration=4.0,
        descent_speed=0.5,
    )


LANDING_MEMORY = np.dtype(
    [
        ("state", np.int64),
        ("trajectory_status", np.int64),
        ("reason", np.int64),
        ("arm_seen", np.int64),
        ("go_seen", np.int64),
        ("attitude_known", np.int64),
        ("attitude", np.float64, (4,)),
        ("start_time", np.float64),
        ("flip_time", np.float64),
        ("usable_time", np.float64),
        ("hold_time", np.float64),
        ("hold_position", np.float64, (3,)),
        ("hold_velocity", np.float64, (3,)),
        ("snapshot_count", np.int64),
        ("snapshot_time", np.float64),
        ("snapshot_tau", np.float64),
        ("snapshot_theta_x", np.float64),
        ("snapshot_d_ceil", np.float64),
        ("snapshot_trigger_value", np.float64),
        ("snapshot_a_rot", np.float64),
        ("snapshot_velocity", np.float64, (3,)),
        ("snapshot_z", np.float64),
        ("snapshot_pitch", np.float64),
    ]
)
"""Everything that the machine remembers.

`state` is a LandingState, `trajectory_status` a TrajectoryStatus (:mod:`onboard.app_interface`), `reason` an
`EndReason`; `attitude` is propagated from the gyro; `usable_time` is when the estimate was last usable while
braking and holding; `snapshot_*` is the sample that triggered the last flip
(SI, `snapshot_pitch` rad, positive nose down), `snapshot_count` counts flips.
"""


def new_landing_memory() -> Any:
    """Memory of a machine that has just been switched on: one record of `LANDING_MEMORY`, state IDLE.

    A numpy record, so that its fields are attributes in compiled and in interpreted code alike.
    """
    return np.zeros(1, dtype=LANDING_MEMORY).view(np.recarray)[0]
