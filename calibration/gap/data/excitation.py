"""How much each part of a flight can be trusted to tell about torques.

In quiet flight nearly all torque that is commanded answers noise: of the gyro, of the air. A log at 100 Hz
shows a fifth of those answers, late and mixed with their cause, and what is learned from them is wrong: on
flights of a known vehicle a delay of 1 ms comes out at 6 ms, an inertia at half its error. What somebody
commanded is free of it. So a part counts by how much of its commanded angular acceleration is beyond what the
quietest parts show, where the controller talks to itself.
"""

import itertools

import numpy as np

from calibration.gap.data.signals import CHANNELS, TORQUE, Signals, window_means
from onboard.arrays import FloatArray

WINDOW = 0.1
"""s: angular acceleration is averaged over this long; what is commanded is slower, most noise is faster."""

_QUIET = 0.1
"""Share of the parts that are taken to be quiet."""

_BEYOND = 3.0
"""Variance of the quiet parts that is taken off each part: answers grow with the motion."""

_EXCITED = 0.5
"""Weight of a part in which most of the motion was commanded."""

_SEVERAL = 3

_AMPLIFIED = 10.0
"""Most that a controller's answers to noise and gusts vary, in variances of what no model explains (1.4 to 5
in quiet parts of six sets of three programs). Motion of which a model leaves less is the vehicle's own: one
that shakes all the time (126 where commands came 11 ms late) is quiet nowhere, and answers nothing there."""

_LEAST = 0.01
"""Weight of a part without any excitation."""


def excitation_weights(variance: FloatArray, quiet: FloatArray) -> FloatArray:
    """Weight of each part in each channel, shape (parts, 7), at most 1; it is 1 but for torques.

    Args:
        variance: of what was commanded in each part, from :func:`commanded`.
        quiet: where the vehicle is quiet, from :func:`quiet_level` of these flights, or of others of its own.
    """
    weights = np.ones((variance.shape[0], len(CHANNELS)))
    share = 1.0 - np.minimum(_BEYOND * quiet / np.maximum(np.maximum(variance, quiet), 1e-300), 1.0)
    weights[:, TORQUE] = np.where(variance.any(axis=0), np.maximum(share, _LEAST), 1.0)
    return weights


def commanded(signals: Signals, predicted: FloatArray) -> FloatArray:
    """Variance of the angular accelerations among `predicted`, shape (n, 7), in each part, shape (parts, 3),
    rad2/s4: by a model of the vehicle what was commanded."""
    return np.array(
        [
            _variance(predicted[first:end, TORQUE], signals.valid[first:end, TORQUE], signals.dt)
            for first, end in itertools.pairwise(signals.part_bounds)
        ]
    )


def quiet_level(variance: FloatArray) -> FloatArray:
    """That of the quietest parts, shape (3,); 0 about an axis that nothing is known of."""
    known = np.where(variance > 0.0, variance, np.nan)
    told = np.isfinite(known).any(axis=0)
    level = np.zeros(3)
    level[told] = np.nanquantile(known[:, told], _QUIET, axis=0)
    return level


def answered(quiet: FloatArray, signals: Signals, predicted: FloatArray) -> FloatArray:
    """As much of a quiet level, shape (3,), as may answer what no model explains.

    Args:
        quiet: from :func:`quiet_level`.
        signals: of the flights.
        predicted: signals by the best model of them, shape (n, 7).
    """
    left = commanded(signals, signals.measured - predicted)
    return np.minimum(quiet, _AMPLIFIED * quiet_level(left))


def only_excited(weights: FloatArray) -> FloatArray:
    """The weights, shape (parts, 7), of parts in which most of the motion was commanded; others have none."""
    return np.where(weights >= _EXCITED, weights, 0.0)


def excited(weights: FloatArray) -> bool:
    """Whether roll or pitch was commanded in several parts, so that delays and levers can be told at all."""
    rolling = weights[:, TORQUE.start : TORQUE.start + 2].max(axis=1)
    return int((rolling >= _EXCITED).sum()) >= _SEVERAL


def _variance(values: FloatArray, valid: np.ndarray, dt: float) -> FloatArray:
    """Variance of means over :data:`WINDOW`, shape (3,); windows with rows not valid are left out."""
    window = max(1, round(WINDOW / dt))
    means = window_means(values, window)
    whole = valid[: means.shape[0] * window].reshape(-1, window, 3).all(axis=(1, 2))
    return means[whole].var(axis=0) if whole.sum() > 1 else np.zeros(3)
