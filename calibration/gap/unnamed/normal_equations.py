"""Normal equations of piecewise-linear profiles: of the whitened residual, and of its block means.

A vehicle under control moves where disturbances push it, so that even pure noise goes with position and
speed: histograms of a noise residual over speed "explain" a tenth of it, and circular shifts, which tear that
link too, call it significant. Three things break it. The residual is whitened by its own past, because its
innovations are new to the motion up to now. What a regressor did within the last moments is fitted beside its
profile, because a motion knows of forces what a noisy accelerometer does not. And profiles are smooth: the
steps of a histogram do not survive whitening. Chance is drawn by turning the signs of blocks of their score
(sign-flipping score test; Hemerik, Goeman, Finos, Journal of the Royal Statistical Society B 82, 2020). Block
means of the residual itself only say how much a profile explains.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from calibration.gap.data.signals import Signals
from calibration.gap.estimate.noise import ORDER, fit_autoregression, whiten, whole_windows
from calibration.gap.unnamed.blocks import Blocks, grouped_mean
from onboard.arrays import BoolArray, FloatArray
from onboard.jit import kept

_WEIGHTS = (0.5, 2.0)
"""Range of a flight's noise, in units of the median flight's, within which it weighs by its noise."""


class Grid(NamedTuple):
    """Regressors as the sums need them.

    Attributes:
        place: of each regressor among its knots at each row, 0 .. hats - 1, shape (n, r); -1 where unknown.
        fast: what each did in the last moments, shape (n, r, extra), to be fitted beside the hat functions.
        hats: number of knots.
    """

    place: FloatArray
    fast: FloatArray
    hats: int


@dataclass(frozen=True)
class NormalEquations:
    """Of channels c against regressors r with columns k: hat functions, then fast parts.

    Part means are removed from residual and columns.

    Attributes:
        score: residual times hats, by block, shape (blocks, c, r, k).
        matrix: hats times hats, by part, shape (parts, c, r, k, k).
        total: square of the residual, shape (c,).
        part: of each block, shape (blocks,).
    """

    score: FloatArray
    matrix: FloatArray
    total: FloatArray
    part: np.ndarray


@kept(nogil=True)
def _add_up(
    innovations: FloatArray,
    used: BoolArray,
    coefficients: FloatArray,
    place: FloatArray,
    fast: FloatArray,
    groups: tuple[np.ndarray, np.ndarray],
    out: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    """Add one channel's rows to score (blocks, r, k), matrix (parts, r, k, k), time (parts, r, k)."""
    (block, part), (score, matrix, time) = groups, out
    extra, order = fast.shape[2], coefficients.size
    hats = time.shape[2] - extra
    column, filled = np.zeros(hats + extra), np.empty(hats + extra, dtype=np.int64)
    for row in range(order, place.shape[0]):
        if not used[row]:
            continue
        for r in range(place.shape[1]):
            low, high = hats, -1
            for lag in range(order + 1):
                at = place[row - lag, r]
                if at >= 0.0:
                    factor = 1.0 if lag == 0 else -coefficients[lag - 1]
                    left = min(int(at), hats - 2)
                    column[left] += factor * (left + 1 - at)
                    column[left + 1] += factor * (at - left)
                    low, high = min(low, left), max(high, left + 1)
            count = 0
            for i in range(low, high + 1):
                filled[count] = i
                count += 1
            for i in range(extra):
                column[hats + i] = fast[row, r, i]
                filled[count] = hats + i
                count += 1
            for i in filled[:count]:
                score[block[row], r, i] += column[i] * innovations[row]
                time[part[row], r, i] += column[i]
                for j in filled[:count]:
                    matrix[part[row], r, i, j] += column[i] * column[j]
            for i in filled[:count]:
                column[i] = 0.0


def whitened_equations(
    signals: Signals, blocks: Blocks, values: FloatArray, valid: BoolArray, grid: Grid
) -> NormalEquations:
    """Normal equations of innovations against whitened hat functions of the regressors, and their fast parts.

    Args:
        signals: of the flights.
        blocks: of the flights.
        values: residual by channel, shape (n, c), 0 where not valid.
        valid: shape (n, c).
        grid: the regressors.
    """
    whole = whole_windows(valid, signals.bounds, ORDER)
    coefficients = fit_autoregression(values, whole, ORDER)
    innovations = whiten(values, whole, coefficients)
    parts, channels = signals.part_bounds.size - 1, values.shape[1]
    shape = (grid.place.shape[1], grid.hats + grid.fast.shape[2])
    score = np.zeros((blocks.part.size, channels, *shape))
    matrix = np.zeros((parts, channels, *shape, shape[1]))
    total = np.zeros(channels)
    for c in range(channels):
        used = whole[:, c]
        rows = np.bincount(signals.part[used], minlength=parts)
        mean = grouped_mean(innovations[used, c], signals.part[used], parts)
        centred = np.where(used, innovations[:, c] - mean[signals.part], 0.0)
        sums = (
            np.zeros((blocks.part.size, *shape)),
            np.zeros((parts, *shape, shape[1])),
            np.zeros((parts, *shape)),
        )
        fast = _whitened_fast(grid.fast, used, coefficients[c])
        _add_up(centred, used, coefficients[c], grid.place, fast, (blocks.of_row, signals.part), sums)
        average = sums[2] / np.maximum(rows, 1)[:, None, None]
        per_block = np.bincount(blocks.of_row, centred, blocks.part.size)
        weight = _weights(centred, used, signals)
        of_part = np.repeat(weight, parts // signals.flights)
        of_block = of_part[blocks.part][:, None, None]
        score[:, c] = of_block * (sums[0] - average[blocks.part] * per_block[:, None, None])
        both = rows[:, None, None, None] * average[..., :, None] * average[..., None, :]
        matrix[:, c] = of_part[:, None, None, None] * (sums[1] - both)
        total[c] = float(weight[signals.flight] @ centred**2)
    return NormalEquations(score, matrix, total, blocks.part)


def _whitened_fast(fast: FloatArray, used: BoolArray, coefficients: FloatArray) -> FloatArray:
    flat = np.ascontiguousarray(fast.reshape(fast.shape[0], fast.shape[1] * fast.shape[2]))
    whole = np.repeat(used[:, None], flat.shape[1], axis=1)
    return whiten(flat, whole, np.tile(coefficients, (flat.shape[1], 1))).reshape(fast.shape)


def block_equations(blocks: Blocks, values: FloatArray, valid: BoolArray, grid: Grid) -> NormalEquations:
    """Normal equations of block means of the residual against those of the hat functions.

    Args:
        blocks: of the flights.
        values: residual of channels that are valid together, shape (n, c).
        valid: shape (n,).
        grid: the regressors, whose fast parts do not count here.
    """
    place, width, full = grid.place, grid.hats, blocks.full(valid)
    number = np.where(full, np.cumsum(full) - 1, -1)
    rows = np.flatnonzero(valid & full[blocks.of_row])
    block, count, part = number[blocks.of_row[rows]], int(full.sum()), blocks.part[full]
    parts, regressors = int(blocks.part.max()) + 1, place.shape[1]
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
    score = np.zeros((full.size, values.shape[1], regressors, width))
    score[full] = averaged[:, :, None, None] * design[:, None]
    matrix = np.zeros((parts, 1, regressors, width, width))
    for p in np.unique(part):
        d = design[part == p].transpose(1, 0, 2)
        matrix[p, 0] = d.transpose(0, 2, 1) @ d
    everywhere = np.broadcast_to(matrix, (parts, values.shape[1], regressors, width, width))
    return NormalEquations(score, everywhere, (averaged**2).sum(axis=0), blocks.part)


def _weights(centred: FloatArray, used: BoolArray, signals: Signals) -> FloatArray:
    """Weight of each flight, shape (flights,), by the inverse variance of its innovations."""
    count = np.bincount(signals.flight[used], minlength=signals.flights)
    power = np.bincount(signals.flight, centred**2, signals.flights) / np.maximum(count, 1)
    present = power > 0.0
    if not present.any():
        return np.zeros(signals.flights)
    noise = np.sqrt(power / np.median(power[present]))
    return np.where(present, np.clip(noise, *_WEIGHTS) ** -2.0, 0.0)
