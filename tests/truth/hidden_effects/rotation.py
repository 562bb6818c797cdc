"""Attitudes of the hidden flights: unit quaternions scalar-last, body to world."""

import math

from tests.truth.hidden_effects.jit import Array, jitted


@jitted
def sum3(a: float, b: float, c: float, x: float, y: float, z: float) -> float:
    return a * x + b * y + c * z


@jitted
def wrap(angle: float) -> float:
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@jitted
def rotation(x: float, y: float, z: float, w: float, r: Array) -> None:
    """Matrix body to world of a unit quaternion."""
    r[0, 0], r[0, 1], r[0, 2] = w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)
    r[1, 0], r[1, 1], r[1, 2] = 2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)
    r[2, 0], r[2, 1], r[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z


@jitted
def turn(q: Array, x: float, y: float, z: float) -> None:
    """Turn the quaternion `q` in place by the rotation vector (x, y, z) in its own frame."""
    angle = math.sqrt(x * x + y * y + z * z)
    s = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    c = math.cos(0.5 * angle)
    x, y, z = s * x, s * y, s * z
    a, b, d, w = q[0], q[1], q[2], q[3]
    q[0] = w * x + a * c + b * z - d * y
    q[1] = w * y + b * c + d * x - a * z
    q[2] = w * z + d * c + a * y - b * x
    q[3] = w * c - a * x - b * y - d * z


@jitted
def attitude_error(q: Array, m: Array, out: Array) -> None:
    """Rotation vector (small angles) from the attitude `q` to `m`, in the frame of `q`."""
    s = 2.0 if q[0] * m[0] + q[1] * m[1] + q[2] * m[2] + q[3] * m[3] > 0.0 else -2.0
    out[0] = s * (q[3] * m[0] - q[0] * m[3] - q[1] * m[2] + q[2] * m[1])
    out[1] = s * (q[3] * m[1] - q[1] * m[3] - q[2] * m[0] + q[0] * m[2])
    out[2] = s * (q[3] * m[2] - q[2] * m[3] - q[0] * m[1] + q[1] * m[0])
