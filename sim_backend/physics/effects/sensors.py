"""What motion capture and gyro report of a state: pose_rotation, pose_offset, gyro_bias, com_offset.

What is tracked is the middle of the drone, which com_offset moves away from the centre of mass. The delay of
the pose is for those who keep the past.
"""

import math
from typing import Any

from onboard.arrays import Quaternion, Vector
from onboard.rotation import multiply, rotate
from sim_backend.physics.jit import kernel, outlined


@kernel
def tracked_position(state: Any, p: Any) -> Vector:
    """Position (m, world) of the origin that is tracked."""
    at, centre, offset = state.position, p.geometric_centre, p.pose_offset
    if not p.sensors_on:
        return at[0], at[1], at[2]
    b = (centre[0] + offset[0], centre[1] + offset[1], centre[2] + offset[2])
    x, y, z = rotate(state.quaternion, b)
    return at[0] + x, at[1] + y, at[2] + z


@kernel
def tracked_attitude(state: Any, p: Any) -> Quaternion:
    """Attitude (x, y, z, w) of the frame that is tracked."""
    q, t = state.quaternion, p.pose_turn
    if not p.sensors_on:
        return q[0], q[1], q[2], q[3]
    w = math.sqrt(1.0 - (t[0] * t[0] + t[1] * t[1] + t[2] * t[2]))
    return multiply(q, (t[0], t[1], t[2], w))


@outlined
def tracked_first(states: Any, parameters: Any) -> tuple[Vector, Quaternion]:
    """Position (m, world) and attitude of the frame that is tracked, of the first record of each array: for
    callers in Python, as :func:`sim_backend.physics.step.step_first`."""
    return tracked_position(states[0], parameters[0]), tracked_attitude(states[0], parameters[0])


@kernel
def measured_rate(state: Any, p: Any) -> Vector:
    """Body rate (rad/s) with the bias of the gyro, without noise."""
    w, bias = state.omega, p.gyro_bias
    return w[0] + bias[0], w[1] + bias[1], w[2] + bias[2]
