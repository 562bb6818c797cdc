"""Quaternions of unit length on one hemisphere, so that they can be interpolated and differenced."""

import numpy as np

from onboard.arrays import FloatArray


def continuous_quaternions(quaternions: FloatArray) -> FloatArray:
    """`quaternions`, shape (n, 4), of unit length, each with the sign that is nearest to the one before.

    A quaternion and its negative are the same attitude; a jump from one to the other is none of the vehicle.
    """
    unit = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    flips = np.sum(unit[1:] * unit[:-1], axis=1) < 0.0
    sign = np.where(np.cumsum(flips) % 2 == 0, 1.0, -1.0)
    unit[1:] *= sign[:, None]
    return unit
