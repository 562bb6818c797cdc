"""Normal equations of piecewise-linear profiles: of the whitened residual, and of its block means.

A vehicle under control moves where disturbances push it, so that even pure noise goes with position and
speed: histograms of a noise residual over speed "explain" a tenth of it, and circular shifts, which tear that
link too, call it significant. Only innovations are free of it: they are new, and the motion up to now cannot
know them. Profiles (smooth ones: the steps of a histogram do not survive whitening) are therefore fitted to
the residual whitened by its own past; chance is drawn by turning the signs of whole seconds of their score
(sign-flipping score test; Hemerik, Goeman, Finos, Journal of the Royal Statistical Society B 82, 2020). Block
means of the residual itself only say how much a profile explains.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from calibration.gap.localisation.blocks import Spans, grouped_mean
from calibration.gap.noise import ORDER, fit_autoregression, whiten, whole_windows
from calibration.gap.signals import Signals
from onboard.arrays import BoolArray, FloatArray

_WEIGHTS = (0.5, 2.0)
"""Range of a flight's noise, in units of the median flight's, within which it weighs by its noise."""


@dataclass(frozen=True)
class Sums:
    """Of channels c against regressors r with hat functions k; part means are removed from both sides.

    Attributes:
        score: residual times hats, by unit, shape (units, c, r, k).
        matrix: hats times hats, by part, shape (parts, c, r, k, k).
        total: square of the residual, shape (c,).
        part_of_unit: shape (units,).
    """

    score: FloatArray
    matrix: FloatArray
    total: FloatArray
    part_of_unit: np.ndarray


@njit(cache=True, nogil=True)
def _add_up(
    innovations: FloatArray,
    used: BoolArray,
    coefficients: FloatArray,
    place: FloatArray,
    unit: np.ndarray,
    part: np.ndarray,
    out: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    """Add one channel's rows to score (units, r, k), matrix (parts, r, k, k), time (parts, r, k)."""
    score, matrix, time = out
    regressors, width, order = place.shape[1], time.shape[2], coefficients.size
    share = np.zeros(width)
    for row in range(order, place.shape[0]):
        if not used[row]:
            continue
        for r in range(regressors):
            low, high = width, -1
            for lag in range(order + 1):
                at = place[row - lag, r]
                if at >= 0.0:
                    factor = 1.0 if lag == 0 else -coefficients[lag - 1]
                    left = min(int(at), width - 2)
                    share[left] += factor * (left + 1 - at)
                    share[left + 1] += factor * (at - left)
                    low, high = min(low, left), max(high, left + 1)
            for i in range(low, high + 1):
                if share[i] != 0.0:
                    score[unit[row], r, i] += share[i] * innovations[row]
                    time[part[row], r, i] += share[i]
                    for j in range(low, high + 1):
                        matrix[part[row], r, i, j] += share[i] * share[j]
            for i in range(low, high + 1):
                share[i] = 0.0


def whitened_sums(
    signals: Signals, spans: Spans, values: FloatArray, valid: BoolArray, place: FloatArray, width: int
) -> Sums:
    """Sums of innovations against whitened hat functions of the regressors.

    Args:
        signals: of the flights.
        spans: their blocks and units.
        values: residual by channel, shape (n, c), 0 where not valid.
        valid: shape (n, c).
        place: of each regressor among its knots at each row, 0 .. width - 1, shape (n, r); -1 where unknown.
        width: number of knots.
    """
    order = ORDER
    whole = whole_windows(valid, signals.bounds, order)
    coefficients = fit_autoregression(values, whole, order)
    innovations = whiten(values, whole, coefficients)
    units, parts, regressors = spans.part_of_unit.size, signals.part_bounds.size - 1, place.shape[1]
    channels = values.shape[1]
    score = np.zeros((units, channels, regressors, width))
    matrix = np.zeros((parts, channels, regressors, width, width))
    total = np.zeros(channels)
    for c in range(channels):
        used = whole[:, c]
        count = np.bincount(signals.part[used], minlength=parts)
        mean = grouped_mean(innovations[used, c], signals.part[used], parts)
        centred = np.where(used, innovations[:, c] - mean[signals.part], 0.0)
        time = np.zeros((parts, regressors, width))
        sums = np.zeros((units, regressors, width)), np.zeros((parts, regressors, width, width)), time
        _add_up(centred, used, coefficients[c], place, spans.unit, signals.part, sums)
        average = time / np.maximum(count, 1)[:, None, None]
        per_unit = np.bincount(spans.unit, centred, units)
        weight = _weights(centred, used, signals)
        of_part = np.repeat(weight, parts // signals.flights)
        of_unit = of_part[spans.part_of_unit][:, None, None]
        score[:, c] = of_unit * (sums[0] - average[spans.part_of_unit] * per_unit[:, None, None])
        both = count[:, None, None, None] * average[..., :, None] * average[..., None, :]
        matrix[:, c] = of_part[:, None, None, None] * (sums[1] - both)
        total[c] = float(weight[signals.flight] @ centred**2)
    return Sums(score, matrix, total, spans.part_of_unit)


def block_sums(spans: Spans, values: FloatArray, valid: BoolArray, place: FloatArray, width: int) -> Sums:
    """Sums of block means of the residual against those of the hat functions.

    Args:
        spans: blocks and units.
        values: residual of channels that are valid together, shape (n, c).
        valid: shape (n,).
        place, width: as for :func:`whitened_sums`.
    """
    full = spans.full_blocks(valid)
    number = np.where(full, np.cumsum(full) - 1, -1)
    rows = np.flatnonzero(valid & full[spans.block])
    block, count = number[spans.block[rows]], int(full.sum())
    unit = spans.unit_of_block[full]
    part = spans.part_of_unit[unit]
    parts, units, regressors = int(spans.part_of_unit.max()) + 1, spans.part_of_unit.size, place.shape[1]
    averaged = grouped_mean(values[rows], block, count)
    averaged -= grouped_mean(averaged, part, parts)[part]
    sizes = np.bincount(block, minlength=count)
    design = np.zeros((count, regressors, width))
    for r in range(regressors):
        known = place[rows, r] >= 0.0
        at = place[rows[known], r]
        left = np.minimum(at.astype(int), width - 2)
        label, size = block[known] * width + left, count * width
        time = np.bincount(label, left + 1 - at, size) + np.bincount(label + 1, at - left, size)
        design[:, r] = time.reshape(count, width) / sizes[:, None]
    design -= grouped_mean(design, part, parts)[part]
    score = np.zeros((units, values.shape[1], regressors, width))
    np.add.at(score, unit, averaged[:, :, None, None] * design[:, None])
    matrix = np.zeros((parts, 1, regressors, width, width))
    for p in np.unique(part):
        d = design[part == p].transpose(1, 0, 2)
        matrix[p, 0] = d.transpose(0, 2, 1) @ d
    everywhere = np.broadcast_to(matrix, (parts, values.shape[1], regressors, width, width))
    return Sums(score, everywhere, (averaged**2).sum(axis=0), spans.part_of_unit)


def _weights(centred: FloatArray, used: BoolArray, signals: Signals) -> FloatArray:
    """Weight of each flight, shape (flights,), by the inverse variance of its innovations."""
    count = np.bincount(signals.flight[used], minlength=signals.flights)
    power = np.bincount(signals.flight, centred**2, signals.flights) / np.maximum(count, 1)
    present = power > 0.0
    if not present.any():
        return np.zeros(signals.flights)
    noise = np.sqrt(power / np.median(power[present]))
    return np.where(present, np.clip(noise, *_WEIGHTS) ** -2.0, 0.0)
