"""Rotations as the mocap protocols write them, in plain floats (one body a frame needs no arrays,
and a compiled function would stall the first frame).

Quaternions are (x, y, z, w), unit, body to world. Matrices are nine floats, row-major, body to world.
"""

import math

from onboard.arrays import Quaternion, Vector

Matrix = tuple[float, float, float, float, float, float, float, float, float]


def normalised(q: Quaternion) -> Quaternion:
    """The unit quaternion along `q` (`q` must not be zero)."""
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale)


def dot(a: Quaternion, b: Quaternion) -> float:
    """Scalar product of two quaternions; negative when they lie in opposite half-spaces."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


def continuous(q: Quaternion, previous: Quaternion | None) -> Quaternion:
    """`q` or ``-q``, the same rotation, whichever lies in the half-space of `previous`."""
    if previous is not None and dot(q, previous) < 0.0:
        return (-q[0], -q[1], -q[2], -q[3])
    return q


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product: the rotation `b` followed by `a`."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def rotate(q: Quaternion, v: Vector) -> Vector:
    """The vector `v` turned by the unit quaternion `q`."""
    m = matrix_from_quaternion(q)
    return (
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
        m[6] * v[0] + m[7] * v[1] + m[8] * v[2],
    )


def angle_between(a: Quaternion, b: Quaternion) -> float:
    """Smallest rotation angle from `a` to `b`, 0..pi rad, accurate at both ends."""
    x, y, z, w = multiply((-a[0], -a[1], -a[2], a[3]), b)
    return 2.0 * math.atan2(math.sqrt(x * x + y * y + z * z), abs(w))


def slerp(a: Quaternion, b: Quaternion, fraction: float) -> Quaternion:
    """Shortest great-circle interpolation from `a` (fraction 0) to `b` (fraction 1)."""
    b = continuous(b, a)
    half = math.acos(min(1.0, dot(a, b)))
    if half < 1e-6:
        weight_a, weight_b = 1.0 - fraction, fraction
    else:
        weight_a = math.sin((1.0 - fraction) * half) / math.sin(half)
        weight_b = math.sin(fraction * half) / math.sin(half)
    mixed = [weight_a * x + weight_b * y for x, y in zip(a, b, strict=True)]
    return normalised((mixed[0], mixed[1], mixed[2], mixed[3]))


def matrix_from_quaternion(q: Quaternion) -> Matrix:
    """Rotation matrix of a unit quaternion."""
    x, y, z, w = q
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


def quaternion_from_matrix(m: Matrix) -> Quaternion:
    """Unit quaternion of a rotation matrix by Shoemake's branches: divides only by what is large.

    Reference: K. Shoemake, "Animating rotation with quaternion curves", SIGGRAPH 1985.
    """
    trace = m[0] + m[4] + m[8]
    if trace > 0.0:
        q = (m[7] - m[5], m[2] - m[6], m[3] - m[1], 1.0 + trace)
    elif m[0] >= m[4] and m[0] >= m[8]:
        q = (1.0 + m[0] - m[4] - m[8], m[1] + m[3], m[2] + m[6], m[7] - m[5])
    elif m[4] >= m[8]:
        q = (m[1] + m[3], 1.0 - m[0] + m[4] - m[8], m[5] + m[7], m[2] - m[6])
    else:
        q = (m[2] + m[6], m[5] + m[7], 1.0 - m[0] - m[4] + m[8], m[3] - m[1])
    return normalised(q)


def is_rotation(m: Matrix, tolerance: float) -> bool:
    """True when the rows are orthonormal and right-handed to `tolerance` (false with any NaN)."""
    a, b, c = m[0:3], m[3:6], m[6:9]
    products = (
        (a[0] * a[0] + a[1] * a[1] + a[2] * a[2], 1.0),
        (b[0] * b[0] + b[1] * b[1] + b[2] * b[2], 1.0),
        (c[0] * c[0] + c[1] * c[1] + c[2] * c[2], 1.0),
        (a[0] * b[0] + a[1] * b[1] + a[2] * b[2], 0.0),
        (a[0] * c[0] + a[1] * c[1] + a[2] * c[2], 0.0),
        (b[0] * c[0] + b[1] * c[1] + b[2] * c[2], 0.0),
    )
    determinant = (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        - a[1] * (b[0] * c[2] - b[2] * c[0])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
    return determinant > 0.0 and all(abs(value - wanted) <= tolerance for value, wanted in products)


def quaternion_from_euler_xyz(rx: float, ry: float, rz: float) -> Quaternion:
    """Rotation ``Rx(rx) Ry(ry) Rz(rz)`` (intrinsic x, y', z''; rad), as the Tracker UDP stream has it."""
    q_x = (math.sin(rx / 2.0), 0.0, 0.0, math.cos(rx / 2.0))
    q_y = (0.0, math.sin(ry / 2.0), 0.0, math.cos(ry / 2.0))
    q_z = (0.0, 0.0, math.sin(rz / 2.0), math.cos(rz / 2.0))
    return multiply(multiply(q_x, q_y), q_z)


def euler_xyz_from_quaternion(q: Quaternion) -> Vector:
    """Angles (rx, ry, rz) in rad with ``R = Rx Ry Rz``; at ry = +-90 deg rz is set to 0 (singular)."""
    m = matrix_from_quaternion(q)
    cos_y = math.hypot(m[0], m[1])
    ry = math.atan2(m[2], cos_y)
    if cos_y < 1e-9:
        return (math.atan2(m[7], m[4]), ry, 0.0)
    return (math.atan2(-m[5], m[8]), ry, math.atan2(-m[1], m[0]))
