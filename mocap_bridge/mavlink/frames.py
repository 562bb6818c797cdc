"""The one place where our axes become those of MAVLink: world ENU to NED, body FLU to FRD.

North is the room's y axis and east its x axis, whether or not they point there on a map. Both changes of axes
are their own inverses, so the same functions go either way (a quaternion comes back as itself or its
negative, which is the same rotation).
"""

import math

from mocap_bridge.rotation import matrix_from_quaternion, multiply
from onboard.arrays import Quaternion, Vector

_S = math.sqrt(0.5)
_ENU_NED: Quaternion = (_S, _S, 0.0, 0.0)  # half a turn about the bisector of east and north
_FLU_FRD: Quaternion = (1.0, 0.0, 0.0, 0.0)  # half a turn about forward


def swap_world(vector: Vector) -> Vector:
    """(east, north, up) as (north, east, down), and back."""
    x, y, z = vector
    return (y, x, -z)


def swap_body(vector: Vector) -> Vector:
    """(forward, left, up) as (forward, right, down), and back."""
    x, y, z = vector
    return (x, -y, -z)


def swap_attitude(quaternion: Quaternion) -> Quaternion:
    """FLU to ENU as FRD to NED, and back; (x, y, z, w), unit."""
    return multiply(multiply(_ENU_NED, quaternion), _FLU_FRD)


def euler_zyx(quaternion: Quaternion) -> Vector:
    """Roll, pitch, yaw (rad) with ``R = Rz(yaw) Ry(pitch) Rx(roll)``; roll is 0 where pitch is +-90 deg."""
    m = matrix_from_quaternion(quaternion)
    cos_pitch = math.hypot(m[0], m[3])
    pitch = math.atan2(-m[6], cos_pitch)
    if cos_pitch < 1e-9:
        return (0.0, pitch, math.atan2(-m[1], m[4]))
    return (math.atan2(m[7], m[8]), pitch, math.atan2(m[3], m[0]))


def quaternion_from_euler_zyx(roll: float, pitch: float, yaw: float) -> Quaternion:
    """The inverse of :func:`euler_zyx`."""
    q_x = (math.sin(roll / 2.0), 0.0, 0.0, math.cos(roll / 2.0))
    q_y = (0.0, math.sin(pitch / 2.0), 0.0, math.cos(pitch / 2.0))
    q_z = (0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0))
    return multiply(multiply(q_z, q_y), q_x)
