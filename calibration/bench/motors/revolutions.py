"""From edges to whole-revolution speeds: edges that were missed or doubled, and marks that are not alike.

A running median of the intervals says what an interval should be; it is exact wherever the speed only rises
or only falls, so that a motor which starts from rest does not look like missed edges. Speeds are taken from
one passage of a mark to a later one of the same mark: unequal blades or marks cancel.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from calibration.bench.motors.records import TYPICAL_JITTER, EdgeRecord, IntArray, SpeedTrace
from onboard.arrays import FloatArray

MISSED_RATIO = 1.8
"""Interval over its neighbours' median above which an edge in between was missed (bench notes 1.2)."""
DOUBLED_RATIO = 0.45
"""... and below which an edge was counted twice."""
_NEIGHBOURS = 9
"""Intervals of the running median: four bad ones do not move it."""
STANDSTILL = 0.1
"""s without an edge that no speed is taken from: the rotor stood, or crept in its friction."""
SHORTEST = 8e-3
"""s: revolutions are put together up to this length."""
_UNEVEN_SPEED = 1e-3
"""Of the highest speed: unevenness that no instrument makes (air, commutation, dry friction). The same at all
speeds, so that the slow tail, which the law describes worst, does not weigh most."""


@dataclass(frozen=True, slots=True)
class MarkPassages:
    """Edges after repair.

    Attributes:
        times: (n,) s.
        marks: (n,) running number of the mark that passed, missed ones counted.
        missed: edges that the sensor missed.
        doubled: edges that it counted twice (removed).
        lost: edges lost on the line, known from the counter.
    """

    times: FloatArray
    marks: IntArray
    missed: int
    doubled: int
    lost: int

    @property
    def missed_share(self) -> float:
        """Missed edges over all that should have been there."""
        return self.missed / max(self.times.size + self.missed, 1)

    @property
    def doubled_share(self) -> float:
        """Doubled edges over all that were seen."""
        return self.doubled / max(self.times.size + self.doubled, 1)


def usual_interval(intervals: FloatArray) -> FloatArray:
    """Running median (s) of the intervals between marks."""
    from scipy.ndimage import median_filter

    return np.asarray(median_filter(intervals, size=_NEIGHBOURS, mode="nearest"))


def mark_passages(record: EdgeRecord) -> MarkPassages:
    """Repair one part of a recording (see :meth:`EdgeRecord.parts`)."""
    times, counts = record.times, record.counts
    keep = np.ones(times.size, dtype=bool)
    for _ in range(2):
        chosen = np.flatnonzero(keep)
        doubled = _doubled_edges(times[chosen], counts[chosen])
        keep[chosen[doubled]] = False
    lost = int(np.sum(np.diff(counts) - 1)) if counts.size else 0
    removed_before = np.cumsum(~keep)[keep]
    times, counts = times[keep], counts[keep] - removed_before
    passed = np.diff(counts)
    intervals = np.diff(times) / passed
    ratio = intervals / usual_interval(intervals) if intervals.size else intervals
    extra = np.where((ratio > MISSED_RATIO) & (intervals < STANDSTILL), np.rint(ratio) - 1.0, 0.0)
    extra = extra.astype(np.int64)
    marks = np.concatenate([[0], np.cumsum(passed + extra * passed)]).astype(np.int64)[: times.size]
    return MarkPassages(times, marks, int(extra.sum()), int((~keep).sum()), lost)


def _doubled_edges(times: FloatArray, counts: IntArray) -> IntArray:
    """Indices of edges that are a second count of one mark.

    A false edge splits an interval in two. The one to remove is the one without which the intervals around
    are the most even: the later one of a short pair, unless that leaves a worse rest.
    """
    if times.size < 4:
        return np.zeros(0, dtype=np.int64)
    intervals = np.diff(times) / np.diff(counts)
    usual = usual_interval(intervals)
    short = np.flatnonzero(intervals < DOUBLED_RATIO * usual)
    if short.size == 0:
        return short
    padded = np.concatenate([usual[:1], intervals, usual[-1:]])
    without_later = np.abs(intervals[short] + padded[short + 2] - usual[short])
    without_earlier = np.abs(intervals[short] + padded[short] - usual[short])
    return np.unique(np.where(without_later <= without_earlier, short + 1, short))


def speed_trace(
    passages: MarkPassages,
    marks_per_revolution: int,
    name: str,
    jitter: float = TYPICAL_JITTER,
    shortest: float = SHORTEST,
) -> SpeedTrace:
    """Mean speeds over whole revolutions, put together to at least `shortest` (s).

    Args:
        passages: from :func:`mark_passages`.
        marks_per_revolution: blades, or marks on them, that pass in one turn.
        name: of the recording.
        jitter: s, standard deviation of an edge's time.
        shortest: s, least length of a stretch.
    """
    times, turns = passages.times, passages.marks // marks_per_revolution
    phase = passages.marks % marks_per_revolution
    firsts: list[int] = []
    lasts: list[int] = []
    gaps = np.flatnonzero(np.diff(times) > STANDSTILL) + 1
    bounds = [0, *gaps, times.size]
    for begin, stop in pairwise(bounds):
        _chain(times, phase, begin, stop, shortest, firsts, lasts)
    first, last = np.array(firsts, dtype=np.int64), np.array(lasts, dtype=np.int64)
    length = times[last] - times[first]
    speed = 2.0 * np.pi * (turns[last] - turns[first]) / length
    sigma = np.hypot(np.sqrt(2.0) * jitter * speed / length, _UNEVEN_SPEED * np.max(speed, initial=0.0))
    return SpeedTrace(times[first], times[last], speed, sigma, shortest, name)


def _chain(
    times: FloatArray,
    phase: IntArray,
    begin: int,
    stop: int,
    shortest: float,
    firsts: list[int],
    lasts: list[int],
) -> None:
    """Link passages of one mark between `begin` and `stop`, each at least `shortest` after the one before."""
    at = begin
    while at < stop - 1:
        candidate = max(int(np.searchsorted(times[:stop], times[at] + shortest)), at + 1)
        while candidate < stop and phase[candidate] != phase[at]:
            candidate += 1
        if candidate >= stop:
            return
        firsts.append(at)
        lasts.append(candidate)
        at = candidate
