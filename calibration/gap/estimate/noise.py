"""Coloured noise: an autoregressive model of what remains, and the innovations that it leaves.

A controlled vehicle reacts to every disturbance, so its commands are correlated with the past of the noise.
Only one-step, causal innovations whose noise model is fitted together with the effect tell the two apart
(prediction-error method; Ljung, System Identification, 2nd ed. 1999, sections 7 and 13.4).
"""

import numpy as np

from onboard.arrays import BoolArray, FloatArray
from onboard.jit import kept

ORDER = 16
"""Samples of the past: 0.16 s at 100 Hz, enough for a gyro whose noise is differenced."""

_RIDGE = 1e-9


@kept(nogil=True)
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


def _normal_equations(residual: FloatArray, whole: BoolArray, order: int) -> FloatArray:
    """Sums of products of each row and its past, shape (order + 1, order + 1)."""
    rows = np.flatnonzero(whole)
    past = np.stack([residual[rows - i] for i in range(order + 1)])
    return np.asarray(past @ past.T)


_BLOCK = 2048
"""Rows that are whitened together: with their past they stay in the processor's first cache."""


@kept(nogil=True)
def whiten_channel(values: FloatArray, whole: BoolArray, coefficients: FloatArray, out: FloatArray) -> None:
    """:func:`whiten` of one channel, into `out`; all contiguous, so that several rows are one instruction."""
    order, count = coefficients.size, values.size
    out[:order] = 0.0
    for first in range(order, count, _BLOCK):
        end = min(first + _BLOCK, count)
        # Slices with an index from 0 on: one that could be negative is looked at each time, six times slower.
        block, present, used = out[first:end], values[first:end], whole[first:end]
        for k in range(block.size):
            block[k] = present[k]
        for i in range(order):
            coefficient, past = coefficients[i], values[first - 1 - i : end - 1 - i]
            for k in range(block.size):
                block[k] -= coefficient * past[k]
        for k in range(block.size):
            if not used[k]:
                block[k] = 0.0


def whiten(signal: FloatArray, whole: BoolArray, coefficients: FloatArray) -> FloatArray:
    """Innovations e_k = y_k - sum_i a_i y_(k-i) of each channel; 0 where the window is not whole.

    Args:
        signal: shape (n, channels).
        whole: shape (n, channels), from :func:`whole_windows`.
        coefficients: a_1 .. a_order, shape (channels, order).
    """
    out = np.zeros(signal.shape[::-1])
    for c, values in enumerate(signal.T):
        if values.any():
            whiten_channel(
                np.ascontiguousarray(values), np.ascontiguousarray(whole[:, c]), coefficients[c], out[c]
            )
    return np.ascontiguousarray(out.T)


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
