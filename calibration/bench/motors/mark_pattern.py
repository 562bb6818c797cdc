"""What the intervals between marks repeat after: unequal blades betray how many there are."""

from dataclasses import dataclass

import numpy as np

from calibration.bench.motors.revolutions import MarkPassages
from onboard.arrays import FloatArray

LONGEST_PERIOD = 6
_TREND = 12
"""Intervals of the running mean: a multiple of all likely numbers of marks."""
_BLOCK = 60
"""Intervals folded together: one mark miscounted spoils only its block."""
_FEWEST_BLOCKS = 3
_EVIDENCE = 0.2
"""Share of the intervals' variance that a pattern must explain beyond chance."""
_OUTLIER = 0.4


@dataclass(frozen=True, slots=True)
class MarkPattern:
    """The pattern of the intervals.

    Attributes:
        period: marks after which it repeats; None when the marks are alike, or the recording is too short.
        unevenness: largest less smallest interval of the pattern, over the mean.
    """

    period: int | None
    unevenness: float


def mark_pattern(passages: MarkPassages) -> MarkPattern:
    """Fold the intervals by 2 to 6 marks and take the shortest period that explains what any does."""
    from scipy.ndimage import uniform_filter1d

    passed = np.diff(passages.marks)
    single = passed == 1
    if single.sum() < _FEWEST_BLOCKS * _BLOCK:
        return MarkPattern(None, 0.0)
    intervals = np.diff(passages.times) / passed
    deviation = intervals / uniform_filter1d(intervals, _TREND, mode="nearest") - 1.0
    usable = single & (np.abs(deviation) < _OUTLIER)
    marks, deviation = passages.marks[1:][usable], deviation[usable]
    explained = {p: _explained(marks, deviation, p) for p in range(2, LONGEST_PERIOD + 1)}
    most = max(share for share, _ in explained.values())
    if most < _EVIDENCE:
        return MarkPattern(None, max(explained[2][1], 0.0))
    period = min(p for p, (share, _) in explained.items() if share > 0.8 * most)
    return MarkPattern(period, explained[period][1])


def _explained(marks: FloatArray, deviation: FloatArray, period: int) -> tuple[float, float]:
    """Share of the variance that folding by `period` explains beyond chance, and the pattern's range."""
    blocks = marks // _BLOCK
    phase = marks % period
    cell = (blocks - blocks[0]).astype(np.int64) * period + phase
    count = np.bincount(cell)
    total = np.bincount(cell, deviation)
    held = count > 0
    power = float(np.sum(total[held] ** 2 / count[held]))
    chance = float(held.sum()) / deviation.size
    share = power / float(deviation @ deviation)
    # The phase may slip from block to block, so the range comes from the block means.
    block_means = total[held] / count[held]
    spread = float(np.quantile(block_means, 0.95) - np.quantile(block_means, 0.05))
    return (share - chance) / max(1.0 - chance, 1e-9), spread
