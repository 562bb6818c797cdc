"""Coloured noise: an autoregressive model of what remains, and the innovations that it leaves.

A controlled vehicle reacts to every disturbance, so its commands are correlated with the past of the noise.
Only one-step, causal innovations whose noise model is fitted together with the effect tell the two apart
(prediction-error method; Ljung, System Identification, 2nd ed. 1999, sections 7 and 13.4).
"""

import numpy as np

from onboard.arrays import BoolArray, FloatArray
from onboard.jit import njit

ORDER = 16
"""Samples of the past: 0.16 s at 100 Hz, enough for a gyro whose noise is differenced."""

_RIDGE = 1e-9


@njit(cache=True, nogil=True)
def whole_windows(valid: BoolArray, starts: np.ndarray, order: int) -> BoolArray:
    """Rows whose `order` predecessors and themselves are valid and of the same flight, shape (n, channels).

    Args:
        valid: shape (n, channels).
        starts: first row of each flight, and the end.
        order: samples of the past.
    """
    whole = np.zeros(valid.shape, dtype=np.bool_)
    for f in range(starts.size - 1):
        for c in range(valid.shape[1]):
            run = 0
            for k in range(starts[f], starts[f + 1]):
                run = run + 1 if valid[k, c] else 0
                whole[k, c] = run > order
    return whole


@njit(cache=True, nogil=True)
def _normal_equations(residual: FloatArray, whole: BoolArray, order: int) -> FloatArray:
    """Sums of products of each row and its past, shape (order + 1, order + 1)."""
    sums = np.zeros((order + 1, order + 1))
    for k in range(order, residual.size):
        if whole[k]:
            for i in range(order + 1):
                for j in range(i + 1):
                    sums[i, j] += residual[k - i] * residual[k - j]
    for i in range(order + 1):
        for j in range(i):
            sums[j, i] = sums[i, j]
    return sums


@njit(cache=True, nogil=True)
def whiten(signal: FloatArray, whole: BoolArray, coefficients: FloatArray) -> FloatArray:
    """Innovations e_k = y_k - sum_i a_i y_(k-i) of each channel; 0 where the window is not whole.

    Args:
        signal: shape (n, channels).
        whole: shape (n, channels), from :func:`whole_windows`.
        coefficients: a_1 .. a_order, shape (channels, order).
    """
    out = np.zeros(signal.shape)
    order = coefficients.shape[1]
    for c in range(signal.shape[1]):
        if not np.any(signal[:, c]):
            continue
        for k in range(order, signal.shape[0]):
            if whole[k, c]:
                total = signal[k, c]
                for i in range(order):
                    total -= coefficients[c, i] * signal[k - 1 - i, c]
                out[k, c] = total
    return out


def fit_autoregression(residual: FloatArray, whole: BoolArray, order: int = ORDER) -> FloatArray:
    """Autoregressive coefficients of each channel by least squares, shape (channels, order).

    A channel without data gets zeros (and has no innovations either).
    """
    channels = residual.shape[1]
    coefficients = np.zeros((channels, order))
    for c in range(channels):
        if not whole[:, c].any():
            continue
        sums = _normal_equations(np.ascontiguousarray(residual[:, c]), whole[:, c], order)
        matrix = sums[1:, 1:] + _RIDGE * sums[0, 0] * np.eye(order)
        coefficients[c] = np.linalg.solve(matrix, sums[1:, 0])
    return coefficients
