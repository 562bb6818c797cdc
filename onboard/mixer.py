"""From collective and moments to the thrusts of the four motors, and back.

M1 front right, M2 back right, M3 back left, M4 front left at (+-arm_x, +-arm_y), body FLU:

    tau_x = arm_y (F3 + F4 - F1 - F2)
    tau_y = arm_x (F2 + F3 - F1 - F4)
    tau_z = c (F2 + F4 - F1 - F3)

Compiled; nothing is checked: parameters come from a checked vehicle file.
"""

from typing import TypeAlias

import numpy as np

from onboard.jit import kernel

Thrusts: TypeAlias = tuple[float, float, float, float]

ROLL, PITCH, YAW = np.array([[-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0], [-1.0, 1.0, -1.0, 1.0]])
"""Signs of the equations above: moments of the thrusts of M1..M4 about b_x, b_y and b_z, per lever."""


@kernel
def shares(
    tau_x: float, tau_y: float, tau_z: float, arm_x: float, arm_y: float, thrust_to_torque: float
) -> tuple[float, float, float]:
    """What roll, pitch and yaw take of each motor (N), by the signs of :func:`on_motors`."""
    return tau_x / (4.0 * arm_y), tau_y / (4.0 * arm_x), tau_z / (4.0 * thrust_to_torque)


@kernel
def on_motors(base: float, roll: float, pitch: float, yaw: float) -> Thrusts:
    """Thrusts (N) of M1..M4 without limits, for what each gives (`base`) and takes (:func:`shares`)."""
    return (
        base - roll - pitch - yaw,
        base - roll + pitch + yaw,
        base + roll + pitch - yaw,
        base + roll - pitch + yaw,
    )


@kernel
def mix(
    collective: float,
    tau_x: float,
    tau_y: float,
    tau_z: float,
    arm_x: float,
    arm_y: float,
    thrust_to_torque: float,
    thrust_max: float,
) -> Thrusts:
    """Thrusts (N) of M1..M4, each within 0..`thrust_max`, for a collective (N) and body moments (N m).

    Where the motors cannot give everything, attitude comes first: roll and pitch moments are kept (scaled
    together only when they alone exceed the range of a motor), the collective moves as far as they need, up
    as well as down, and yaw gets what room is left.
    """
    roll, pitch, yaw = shares(tau_x, tau_y, tau_z, arm_x, arm_y, thrust_to_torque)
    reach = abs(roll) + abs(pitch)
    if reach > 0.5 * thrust_max:
        roll *= 0.5 * thrust_max / reach
        pitch *= 0.5 * thrust_max / reach
        reach = 0.5 * thrust_max
    base = min(max(0.25 * collective, reach), thrust_max - reach)

    m1, m2, m3, m4 = on_motors(base, roll, pitch, 0.0)
    # Yaw adds to M2 and M4 and takes from M1 and M3.
    most = min(m1, m3, thrust_max - m2, thrust_max - m4)
    least = -min(m2, m4, thrust_max - m1, thrust_max - m3)
    m1, m2, m3, m4 = on_motors(base, roll, pitch, min(max(yaw, least), most))
    return (
        min(max(m1, 0.0), thrust_max),
        min(max(m2, 0.0), thrust_max),
        min(max(m3, 0.0), thrust_max),
        min(max(m4, 0.0), thrust_max),
    )


@kernel
def flip_thrusts(a_rot: float, arm_x: float) -> Thrusts:
    """Thrusts (N) of M1..M4 that flip with the moment `a_rot` (N m about b_y, negative = nose up).

    The collective is zero: two motors run at |a_rot| / (2 arm_x), the other two stop (paper errata 7). A
    moment that is not a number stops all four.
    """
    each = abs(a_rot) / (2.0 * arm_x)
    if a_rot < 0.0:
        return (each, 0.0, 0.0, each)
    if a_rot > 0.0:
        return (0.0, each, each, 0.0)
    return (0.0, 0.0, 0.0, 0.0)
