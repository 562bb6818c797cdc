"""Rotations as small compiled functions that everybody uses.

Quaternions are scalar-last (x, y, z, w), unit length, body to world. Vectors and quaternions come in as
anything with an index (array or tuple) and go out as tuples, so that compiled code allocates nothing.
"""

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from onboard.arrays import FloatArray, Quaternion, Vector
from onboard.jit import kernel

Indexable: TypeAlias = Sequence[float] | FloatArray


@kernel
def multiply(a: Indexable, b: Indexable) -> Quaternion:
    """Quaternion product a b: rotate by `b`, then by `a`."""
    ax, ay, az, aw = a[0], a[1], a[2], a[3]
    bx, by, bz, bw = b[0], b[1], b[2], b[3]
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


@kernel
def conjugate(q: Indexable) -> Quaternion:
    """The inverse rotation of a unit quaternion."""
    return (-q[0], -q[1], -q[2], q[3])


@kernel
def normalise(q: Indexable) -> Quaternion:
    """`q` scaled to unit length; NaN in every part when it has no direction."""
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if not length > 1e-12:
        return (math.nan, math.nan, math.nan, math.nan)
    return (q[0] / length, q[1] / length, q[2] / length, q[3] / length)


@kernel
def rotate(q: Indexable, v: Indexable) -> Vector:
    """A body-frame vector in the world frame: v + 2 w (u x v) + 2 u x (u x v), u the vector part of `q`."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    cx = 2.0 * (y * v[2] - z * v[1])
    cy = 2.0 * (z * v[0] - x * v[2])
    cz = 2.0 * (x * v[1] - y * v[0])
    return (
        v[0] + w * cx + y * cz - z * cy,
        v[1] + w * cy + z * cx - x * cz,
        v[2] + w * cz + x * cy - y * cx,
    )


@kernel
def body_x(q: Indexable) -> Vector:
    """Body axis b1 (forward) in the world frame."""
    return (
        1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]),
        2.0 * (q[0] * q[1] + q[2] * q[3]),
        2.0 * (q[0] * q[2] - q[1] * q[3]),
    )


@kernel
def body_y(q: Indexable) -> Vector:
    """Body axis b2 (left) in the world frame."""
    return (
        2.0 * (q[0] * q[1] - q[2] * q[3]),
        1.0 - 2.0 * (q[0] * q[0] + q[2] * q[2]),
        2.0 * (q[1] * q[2] + q[0] * q[3]),
    )


@kernel
def body_z(q: Indexable) -> Vector:
    """Body axis b3 (up, along the thrust) in the world frame; its z part is <= 0 when upside down."""
    return (
        2.0 * (q[0] * q[2] + q[1] * q[3]),
        2.0 * (q[1] * q[2] - q[0] * q[3]),
        1.0 - 2.0 * (q[0] * q[0] + q[1] * q[1]),
    )


@kernel
def to_matrix(q: Indexable) -> FloatArray:
    """Rotation matrix, shape (3, 3), body to world; its columns are the body axes."""
    matrix = np.empty((3, 3))
    first, second, third = body_x(q), body_y(q), body_z(q)
    for i in range(3):
        matrix[i, 0] = first[i]
        matrix[i, 1] = second[i]
        matrix[i, 2] = third[i]
    return matrix


@kernel
def to_matrices(quaternions: FloatArray) -> FloatArray:
    """Rotation matrices, shape (n, 3, 3), of quaternions of any length, shape (n, 4)."""
    matrices = np.empty((quaternions.shape[0], 3, 3))
    for k in range(quaternions.shape[0]):
        q = normalise(quaternions[k])
        first, second, third = body_x(q), body_y(q), body_z(q)
        # Number by number: numba takes seconds to compile the assignment of a whole matrix.
        for i in range(3):
            matrices[k, i, 0] = first[i]
            matrices[k, i, 1] = second[i]
            matrices[k, i, 2] = third[i]
    return matrices


@kernel
def from_rotation_vector(r: Indexable) -> Quaternion:
    """Exponential map: the rotation by |r| rad about r."""
    angle = math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    # sin(angle/2)/angle; its series below 1e-4 rad is exact to 1e-18.
    scale = 0.5 - angle * angle / 48.0 if angle < 1e-4 else math.sin(0.5 * angle) / angle
    return (scale * r[0], scale * r[1], scale * r[2], math.cos(0.5 * angle))


@kernel
def integrate(q: Indexable, omega: Indexable, dt: float) -> Quaternion:
    """`q` after `dt` s of the constant body rate `omega` (rad/s), normalised."""
    step = from_rotation_vector((omega[0] * dt, omega[1] * dt, omega[2] * dt))
    return normalise(multiply(q, step))


@kernel
def from_yaw(yaw: float) -> Quaternion:
    """Level attitude with heading `yaw` (rad, about world z)."""
    return (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))


@kernel
def euler_angles(q: Indexable) -> Vector:
    """(roll, pitch, yaw) in rad: turns about z, y, x of the moving body; pitch > 0 is nose down."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(min(1.0, max(-1.0, 2.0 * (w * y - z * x))))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return (roll, pitch, yaw)
