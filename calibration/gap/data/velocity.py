"""Velocity from position by a centred local polynomial."""

import numpy as np
from scipy.signal import savgol_filter

from onboard.arrays import FloatArray

HALF_WIDTH_S = 0.04
"""The polynomial is fitted over this much to either side. It looks ahead:
a regressor, never a start state."""


def differentiate(position: FloatArray, dt: float) -> FloatArray:
    """Derivative of `position`, shape (n, 3), sampled every `dt` s.

    Quadratic least squares over +-40 ms (Savitzky and Golay, 1964). With 0.2 mm of noise at 100 Hz the
    velocity has 2.6 mm/s; a jerk of 50 m/s3 biases it by 8 mm/s.
    """
    half = max(round(HALF_WIDTH_S / dt), 1)
    if position.shape[0] < 2 * half + 1:
        return np.gradient(position, dt, axis=0)
    derivative: FloatArray = savgol_filter(position, 2 * half + 1, 2, deriv=1, delta=dt, axis=0)
    return derivative
