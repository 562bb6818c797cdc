"""A profile in words: the range of a regressor in which the mean residual is far from its median."""

import itertools

import numpy as np

from calibration.gap.unnamed.regressors import Regressor
from onboard.arrays import FloatArray

_FAR = 0.5
"""Share of the largest departure that counts as far."""
_STANDARD_ERRORS = 2.5


def where_it_lives(
    regressor: Regressor, knots: FloatArray, profile: FloatArray, errors: FloatArray, time: FloatArray
) -> tuple[FloatArray, str]:
    """The profile about its median over time, and the condition under which it is far from that.

    Args:
        regressor: of the profile.
        knots: of the profile, shape (k,).
        profile, errors: at each knot, shape (k,).
        time: blocks that tell at each knot, shape (k,).
    """
    about = profile - weighted_median(profile, time)
    size = np.abs(about)
    far = (size > _FAR * size.max()) & (size > _STANDARD_ERRORS * errors)
    if not far.any():
        return about, f"nowhere along {regressor.symbol} in particular"
    signs = np.where(far, np.sign(about), 0.0)
    ends = [None, *(0.5 * (knots[1:] + knots[:-1])).tolist(), None]
    words, first = [], 0
    for sign, run in itertools.groupby(signs):
        last = first + len(list(run))
        if sign:
            words.append(regressor.condition(ends[first], ends[last]))
        first = last
    return about, " or ".join(words)


def weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """The value with half of the weight on either side."""
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(reached, 0.5 * reached[-1])])
