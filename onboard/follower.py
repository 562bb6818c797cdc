"""From a commander's setpoint to the wrench that tracks it: take-off, hover, level-out and approach.

Both loops run at 500 Hz: :func:`follow` says what to track, :func:`track` how. Setpoints come less often, 100
a second from the planner and 50 or fewer from a host; in between they move on with their own velocity and
acceleration. A setpoint that stood still and then jumped would be a jolt, which the lead of the moments makes
several times as large, and always at the same instant of the logs. Each axis has a mode. One that is given as
a velocity follows a position that moves with it, at most :data:`LEASH` ahead of the drone. What the drone
remembers is one record, :data:`FOLLOWER_MEMORY`; zeros while the motors stand. Compiled; nothing is checked.
"""

import math
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from onboard.arrays import Quaternion, Vector
from onboard.battery import FULL_RATIO
from onboard.controller import ControllerGains, Wrench, geometric_control
from onboard.gravity import GRAVITY
from onboard.jit import inner, outlined
from onboard.rotation import Indexable, body_z, euler_angles

CONTROL_PERIOD_MS = 2

LEASH = 0.3
"""m: how far a position that follows a velocity setpoint may run ahead."""

LEAST_UPRIGHT = 0.3
"""b3.z of an asked tilt: beyond 73 deg its sideways acceleration grows no more."""

MOST_AGE = 0.1
"""s for which a setpoint moves on by itself; one that nobody renews stands after that."""

_DT = CONTROL_PERIOD_MS / 1000.0


class Mode(IntEnum):
    """How an axis is controlled."""

    DISABLED = 0
    ABSOLUTE = 1
    VELOCITY = 2


_DISABLED = int(Mode.DISABLED)
_ABSOLUTE = int(Mode.ABSOLUTE)
_VELOCITY = int(Mode.VELOCITY)


class FollowerSetpoint(NamedTuple):
    """What a commander asks for, in SI and FLU signs. Plain numbers only: other types would be compiled anew.

    Attributes:
        modes: of x, y, z, each a :class:`Mode`.
        mode_roll, mode_pitch, mode_yaw, mode_quaternion: likewise.
        velocity_body: whether velocity x and y are along the body's heading.
        position, velocity, acceleration: m, m/s, m/s2, world frame.
        roll, pitch, yaw: rad. rates: rad/s about the body axes.
        quaternion: body to world.
        thrust: 0 to 65535, of four motors at their most; counts where z is disabled.
        age: s since it was given.
    """

    modes: tuple[int, int, int]
    mode_roll: int
    mode_pitch: int
    mode_yaw: int
    mode_quaternion: int
    velocity_body: bool
    position: Vector
    velocity: Vector
    acceleration: Vector
    roll: float
    pitch: float
    yaw: float
    rates: Vector
    quaternion: Quaternion
    thrust: float
    age: float


FOLLOWER_MEMORY = np.dtype(
    (
        np.record,
        [
            ("position", np.float64, (3,)),
            ("velocity", np.float64, (3,)),
            ("acceleration", np.float64, (3,)),
            ("yaw", np.float64),
            ("rates", np.float64, (3,)),
            ("integral", np.float64, (3,)),
            ("tracked", np.int64, (3,)),
            ("following", np.int64, (3,)),
            ("following_yaw", np.int64),
        ],
    )
)
"""What is tracked, and what the next step needs of this one.

SI, world frame, rates about the body axes; `integral` is the position integral (m s). `tracked` is 0 for an
axis without a position or velocity error: only its acceleration acts. `following` and `following_yaw` are 1
where the position or the heading moves with a velocity.
"""


def new_follower_memory() -> Any:
    """Memory of a drone whose motors stand: one record of `FOLLOWER_MEMORY`."""
    return np.zeros(1, dtype=FOLLOWER_MEMORY)[0]


@inner
def _follow_axis(
    memory: Any,
    i: int,
    mode: int,
    here: float,
    position: float,
    velocity: float,
    acceleration: float,
    age: float,
) -> None:
    memory.tracked[i] = 1 if mode != _DISABLED else 0
    memory.acceleration[i] = acceleration if mode == _ABSOLUTE else 0.0
    if mode == _VELOCITY:
        start = memory.position[i] if memory.following[i] == 1 else here
        memory.position[i] = min(max(start + velocity * _DT, here - LEASH), here + LEASH)
        memory.velocity[i] = velocity
    else:
        gained = memory.acceleration[i] * age
        memory.position[i] = position + (velocity + 0.5 * gained) * age
        memory.velocity[i] = velocity + gained
    memory.following[i] = 1 if mode == _VELOCITY else 0


@inner
def _follow_heading(memory: Any, setpoint: FollowerSetpoint, yaw: float, age: float) -> None:
    for i in range(3):
        memory.rates[i] = setpoint.rates[i]
    if setpoint.mode_quaternion == _ABSOLUTE:
        memory.yaw = euler_angles(setpoint.quaternion)[2]
    elif setpoint.mode_yaw == _ABSOLUTE:
        memory.yaw = setpoint.yaw + setpoint.rates[2] * age
    else:
        start = memory.yaw if memory.following_yaw == 1 else yaw
        memory.yaw = start + setpoint.rates[2] * _DT
    memory.following_yaw = 1 if setpoint.mode_yaw == _VELOCITY else 0


@inner
def _up_of(roll: float, pitch: float, yaw: float) -> Vector:
    """b3 of the Z-Y-X angles (rad, FLU)."""
    cz, sz = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    cy, sy = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cx, sx = math.cos(0.5 * roll), math.sin(0.5 * roll)
    return body_z(
        (
            cz * cy * sx - sz * sy * cx,
            cz * sy * cx + sz * cy * sx,
            sz * cy * cx - cz * sy * sx,
            cz * cy * cx + sz * sy * sx,
        )
    )


@inner
def _follow_tilt(
    memory: Any,
    setpoint: FollowerSetpoint,
    roll: float,
    pitch: float,
    gains: ControllerGains,
    thrust_max: float,
) -> None:
    """Accelerations that tilt the body as asked; a rate mode keeps the present angle, turning by rate."""
    if setpoint.mode_roll != _VELOCITY:
        roll = setpoint.roll
    if setpoint.mode_pitch != _VELOCITY:
        pitch = setpoint.pitch
    up = _up_of(roll, pitch, memory.yaw)
    if setpoint.modes[2] == _DISABLED:
        thrust = setpoint.thrust / FULL_RATIO * 4.0 * thrust_max / gains.mass
        memory.acceleration[0] = thrust * up[0]
        memory.acceleration[1] = thrust * up[1]
        memory.acceleration[2] = thrust * up[2] - GRAVITY
    else:
        upright = max(up[2], LEAST_UPRIGHT)
        memory.acceleration[0] = GRAVITY * up[0] / upright
        memory.acceleration[1] = GRAVITY * up[1] / upright


@inner
def _integrate(memory: Any, i: int, here: float, limit: float) -> None:
    error = (here - memory.position[i]) * _DT
    if memory.tracked[i] == 1 and math.isfinite(error):
        memory.integral[i] = min(max(memory.integral[i] + error, -limit), limit)


@outlined
def follow(
    memory: Any,
    setpoint: FollowerSetpoint,
    position: Vector,
    quaternion: Quaternion,
    gains: ControllerGains,
    thrust_max: float,
) -> None:
    """What to track, every :data:`CONTROL_PERIOD_MS`.

    Args:
        memory: record of :data:`FOLLOWER_MEMORY`, changed in place.
        setpoint: what is asked for.
        position, quaternion: estimate, m in the world frame, and body to world.
        gains: the gains.
        thrust_max: N, most thrust of a motor.
    """
    roll, pitch, yaw = euler_angles(quaternion)
    age = min(setpoint.age, MOST_AGE)
    velocity = setpoint.velocity
    if setpoint.velocity_body:
        c, s = math.cos(yaw), math.sin(yaw)
        velocity = (c * velocity[0] - s * velocity[1], s * velocity[0] + c * velocity[1], velocity[2])
    for i in range(3):
        _follow_axis(
            memory,
            i,
            setpoint.modes[i],
            position[i],
            setpoint.position[i],
            velocity[i],
            setpoint.acceleration[i],
            age,
        )
    _follow_heading(memory, setpoint, yaw, age)
    if setpoint.modes[0] == _DISABLED:
        _follow_tilt(memory, setpoint, roll, pitch, gains, thrust_max)
    for i in range(3):
        _integrate(memory, i, position[i], gains.integral_limit)


@outlined
def track(
    memory: Any,
    position: Indexable,
    velocity: Indexable,
    quaternion: Indexable,
    gyro: Indexable,
    gains: ControllerGains,
) -> Wrench:
    """The wrench (N, N m) that tracks it, every :data:`CONTROL_PERIOD_MS`, without its lead.

    Args:
        memory: record of :data:`FOLLOWER_MEMORY`, as :func:`follow` left it.
        position, velocity, quaternion: estimate, m, m/s in the world frame, and body to world.
        gyro: rad/s, body frame.
        gains: the gains.
    """
    at, moving = memory.position, memory.velocity
    on_x, on_y, on_z = memory.tracked[0] == 1, memory.tracked[1] == 1, memory.tracked[2] == 1
    return geometric_control(
        position,
        velocity,
        quaternion,
        (gyro[0] - memory.rates[0], gyro[1] - memory.rates[1], gyro[2] - memory.rates[2]),
        memory.integral,
        (at[0] if on_x else position[0], at[1] if on_y else position[1], at[2] if on_z else position[2]),
        (
            moving[0] if on_x else velocity[0],
            moving[1] if on_y else velocity[1],
            moving[2] if on_z else velocity[2],
        ),
        memory.acceleration,
        memory.yaw,
        gains,
    )
