"""Samples that no packet brought: what a log made up between packets, and after the last one."""

from dataclasses import dataclass

import numpy as np

from calibration.gap.data.samples import Samples
from onboard.arrays import BoolArray

_LEAST_STRAIGHT = 4  # samples on one line, which are 5 intervals between measured ones


@dataclass(frozen=True)
class ReceivedSignal:
    """A logged quantity without what was made up.

    Attributes:
        samples: those that were measured.
        lost_s: time within the log that was interpolated (s).
        dead_s: time at its end that was extrapolated (s).
    """

    samples: Samples
    lost_s: float
    dead_s: float


def received(samples: Samples, resolution: float, idle: BoolArray | None = None) -> ReceivedSignal:
    """The measured part of `samples`, shape (n, k).

    Commands of a controller and readings of a sensor never lie on a straight line: where the second
    difference of all columns stays below `resolution` for 5 intervals or more, the log was interpolated (or
    held); where that goes on to the end, the link was lost. `idle`, shape (n,), tells where a straight line
    is true, such as motors that are off.
    """
    straight = _straight(samples, resolution)
    if idle is not None:
        straight &= ~idle
    edges = np.flatnonzero(np.diff(np.concatenate([[False], straight, [False]])))
    starts, ends = edges[::2], edges[1::2]
    long = ends - starts >= _LEAST_STRAIGHT
    count = samples.t.size
    keep = np.ones(count, dtype=np.bool_)
    lost_s = dead_s = 0.0
    for start, end in zip(starts[long], ends[long], strict=True):
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
