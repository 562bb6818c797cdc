"""The period from zero crossings: an estimate that shares nothing with the least squares but the data."""

import numpy as np

from onboard.arrays import FloatArray

_LEVEL = 0.25  # of the local amplitude: a crossing runs from one side of this band to the other
_LARGEST_STEP = 0.2  # of a period between two samples of one crossing
_FEWEST = 4


def crossing_times(time: FloatArray, values: FloatArray, envelope: FloatArray, period: float) -> FloatArray:
    """Times (s) at which `values` cross zero.

    Args:
        time: s, (n,).
        values: without offset, (n,).
        envelope: local amplitude of `values`, (n,).
        period: s, roughly.
    """
    side = np.where(values > _LEVEL * envelope, 1, np.where(values < -_LEVEL * envelope, -1, 0))
    outside = np.flatnonzero(side)
    turns = np.flatnonzero(np.diff(side[outside]) != 0)
    found = []
    for first, last in zip(outside[turns], outside[turns + 1], strict=True):
        t, y = time[first : last + 1], values[first : last + 1]
        if np.max(np.diff(t)) > _LARGEST_STEP * period:
            continue
        slope, level = np.polyfit(t - t[0], y, 1)
        if slope != 0.0:
            found.append(t[0] - level / slope)
    return np.array(found)


def crossing_period(times: FloatArray, period: float) -> float | None:
    """Mean period (s) by regression of crossing `times` on their number; None below four crossings.

    The number comes from `period` (s, to within a quarter over each gap), so gaps do no harm.
    """
    if len(times) < _FEWEST:
        return None
    number = np.concatenate([[0.0], np.cumsum(np.round(np.diff(times) / (0.5 * period)))])
    if number[-1] < _FEWEST - 1:
        return None
    return 2.0 * float(np.polyfit(number, times, 1)[0])
