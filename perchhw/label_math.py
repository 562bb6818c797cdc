"""Rotations for labels: quaternions scalar-last (x, y, z, w), body to world."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def rotation_matrix(quaternion: FloatArray) -> FloatArray:
    """Rotation matrix, body to world, of one quaternion (4,) or many (n, 4): (3, 3) or (n, 3, 3)."""
    x, y, z, w = np.moveaxis(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def advance(quaternion: FloatArray, rate: FloatArray, dt: float) -> FloatArray:
    """The attitude `dt` (s) later at the constant body `rate` (rad/s, shape (3,))."""
    angle = float(np.linalg.norm(rate)) * dt
    if angle == 0.0:
        return quaternion
    axis = rate / np.linalg.norm(rate)
    turn = np.append(np.sin(angle / 2.0) * axis, np.cos(angle / 2.0))
    return _product(quaternion, turn)


def _product(left: FloatArray, right: FloatArray) -> FloatArray:
    x1, y1, z1, w1 = left
    x2, y2, z2, w2 = right
    return np.array(
        [
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
        ]
    )
