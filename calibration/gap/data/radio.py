"""Samples that no packet brought: what a log made up between packets, and after the last one."""

from dataclasses import dataclass

import numpy as np

from calibration.gap.data.samples import Samples
from onboard.arrays import BoolArray

_LEAST_STRAIGHT = 4  # samples on one line, which are 5 intervals between measured ones
_LEAST_STRAIGHT_S = 0.04  # and how long: a smooth command that is logged at 500 Hz looks straight over less
_WINDOW = 256  # samples that are looked at together
_COARSE = 8.0  # resolutions between the values that occur: such commands come in steps, and may stand still
_FINE_SHARE = 10.0  # percent of values that may be closer: clipped ones, and lines that were not found out


@dataclass(frozen=True)
class ReceivedSignal:
    """A logged quantity without what was made up.

    Attributes:
        lost_s: time within the log that was interpolated (s).
        dead_s: time at its end that was extrapolated (s).
    """

    samples: Samples
    lost_s: float
    dead_s: float


def received(
    samples: Samples, resolution: float, idle: BoolArray | None = None, may_stand: bool = False
) -> ReceivedSignal:
    """The measured part of `samples`, shape (n, k).

    Commands of a controller and readings of a sensor never lie on a straight line for long: where all
    columns do, within `resolution` in their second difference, for 5 intervals and 40 ms or more, the log was
    interpolated (or held); where that goes on to the end, the link was lost. `idle`, shape (n,), tells where
    a straight line is true, such as motors that are off. What `may_stand`, as commands that are logged in
    coarse steps (percent, bytes, pulses) do in calm flight, is not lost where it stands still.
    """
    straight = _straight(samples, resolution)
    if may_stand:
        level = _level(samples, resolution)
        if _in_steps(samples, straight & ~level, resolution):
            straight &= ~level
    if idle is not None:
        straight &= ~idle
    edges = np.flatnonzero(np.diff(np.concatenate([[False], straight, [False]])))
    count = samples.t.size
    keep = np.ones(count, dtype=np.bool_)
    lost_s = dead_s = 0.0
    lines = [
        line
        for start, end in zip(edges[::2], edges[1::2], strict=True)
        for line in _lines(samples, int(start), int(end), 0.5 * resolution)
    ]
    for start, end in lines:
        if end == count - 1:  # the last sample has no second difference: it is as made up as those before
            keep[start:] = False
            dead_s = float(samples.t[-1] - samples.t[start - 1])
        else:
            keep[start:end] = False
            lost_s += float(samples.t[end] - samples.t[start - 1])
    return ReceivedSignal(samples.where(keep), lost_s, dead_s)


def _straight(samples: Samples, resolution: float) -> BoolArray:
    """Samples that lie on the line between their neighbours in all columns; the two ends do not."""
    t, v = samples.t, samples.values
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    bend = 2.0 * (v[:-2] + share * (v[2:] - v[:-2]) - v[1:-1])  # the second difference on a uniform grid
    straight = np.zeros(t.size, dtype=np.bool_)
    straight[1:-1] = np.all(np.abs(bend) < resolution, axis=1)
    return straight


def _level(samples: Samples, resolution: float) -> BoolArray:
    """Samples that are as their neighbours in all columns; the two ends are not."""
    same = np.all(np.abs(np.diff(samples.values, axis=0)) < 0.5 * resolution, axis=1)
    level = np.zeros(samples.t.size, dtype=np.bool_)
    level[1:-1] = same[:-1] & same[1:]
    return level


def _in_steps(samples: Samples, made_up: BoolArray, resolution: float) -> bool:
    """Whether the values that were measured are far from each other, as no noise would leave them."""
    apart = np.concatenate([np.diff(np.unique(column)) for column in samples.values[~made_up].T])
    return bool(apart.size and np.percentile(apart, _FINE_SHARE) >= _COARSE * resolution)


def _lines(samples: Samples, start: int, end: int, tolerance: float) -> list[tuple[int, int]]:
    """Parts of ``start:end`` that lie on one line each and are long enough to be a gap.

    What bends a little at every sample has small second differences too; over a gap it leaves the line.
    """
    lines = []
    while end - start >= _LEAST_STRAIGHT:
        stop = _end_of_line(samples, start - 1, end, tolerance)
        if stop - start >= _LEAST_STRAIGHT and samples.t[stop] - samples.t[start - 1] >= _LEAST_STRAIGHT_S:
            lines.append((start, stop))
        start = stop + 1
    return lines


def _end_of_line(samples: Samples, anchor: int, end: int, tolerance: float) -> int:
    """Last index up to `end` that lies on one line with `anchor` and all between."""
    low, high = np.full(samples.values.shape[1], -np.inf), np.full(samples.values.shape[1], np.inf)
    first = anchor + 1
    while first <= end:
        part = slice(first, min(first + _WINDOW, end + 1))
        run = (samples.t[part] - samples.t[anchor])[:, None]
        off = samples.values[part] - samples.values[anchor]
        lows = np.maximum.accumulate(np.vstack([low, (off - tolerance) / run]))[1:]
        highs = np.minimum.accumulate(np.vstack([high, (off + tolerance) / run]))[1:]
        missed = np.flatnonzero(np.any(lows > highs, axis=1))
        if missed.size:
            return first + int(missed[0]) - 1
        low, high, first = lows[-1], highs[-1], part.stop
    return end
