"""From where a flight can be predicted, and what kind of flying it was there."""

import numpy as np
from numpy.typing import NDArray

from calibration.gap.replay.inputs import PredictionInputs
from onboard.arrays import BoolArray, FloatArray

Rows = NDArray[np.int64]

BEFORE = 0.15
"""s before a start that must be known: motors lag, and the velocity comes from the past (gap note, 1.7)."""

NEAR_CEILING = 0.3
"""m from ceiling to tracked origin."""
NEAR_GROUND = 0.25
"""m from floor to tracked origin."""
FLIPPING = 0.5
"""Cosine of the tilt below which the vehicle is thrown rather than flown."""
VERTICAL = 0.3
"""m/s of climb or sink, that also outweighs the horizontal speed."""
FAST = 1.0
SLOW = 0.25
"""m/s."""


PHASES = ("flip", "near_ceiling", "near_ground", "vertical", "fast", "hover", "cruise")
"""Kinds of flying; the first that holds, in this order."""


def phase_indices(inputs: PredictionInputs, rows: Rows) -> Rows:
    """Index in :data:`PHASES` at the samples `rows`."""
    z = inputs.position[rows, 2]
    velocity = inputs.velocity[rows]
    level = np.hypot(velocity[:, 0], velocity[:, 1])
    speed = np.linalg.norm(velocity, axis=1)
    ceiling = inputs.record.ceiling_z
    tests = {
        "flip": inputs.rotation[rows, 2, 2] < FLIPPING,
        "near_ceiling": z > (np.inf if ceiling is None else ceiling - NEAR_CEILING),
        "near_ground": z < NEAR_GROUND,
        "vertical": (np.abs(velocity[:, 2]) > VERTICAL) & (np.abs(velocity[:, 2]) > level),
        "fast": speed > FAST,
        "hover": speed < SLOW,
        "cruise": np.ones(rows.size, dtype=bool),
    }
    return np.select([tests[phase] for phase in PHASES], range(len(PHASES))).astype(np.int64)


def usable_lengths(inputs: PredictionInputs) -> Rows:
    """Samples that may be predicted from each sample on, shape (n,); -1 where nothing may start.

    A start has all of :data:`BEFORE` known; from it on everything is known and in free flight.
    """
    usable = inputs.known & inputs.record.flying
    ahead = _run_ahead(usable)
    behind = _run_ahead(inputs.known[::-1])[::-1]
    may_start = (behind >= inputs.rows(BEFORE)) & np.isfinite(inputs.start_velocity).all(axis=1)
    return np.where(may_start, ahead, -1)


def start_rows(lengths: Rows, every: int, shortest: int) -> Rows:
    """Every `every`-th sample among those from which at least `shortest` samples may be predicted."""
    rows = np.arange(0, lengths.size, every)
    return rows[lengths[rows] >= shortest]


def _run_ahead(good: BoolArray) -> Rows:
    """How many samples after each one are good without a break; -1 where it is not good itself."""
    rows = np.arange(good.size)
    bad = np.where(good, good.size, rows)
    following = np.minimum.accumulate(bad[::-1])[::-1]
    return following - rows - 1


def longest_stretch(good: BoolArray) -> slice:
    """The longest run of good samples; empty when there is none."""
    ahead = _run_ahead(good)
    if ahead.size == 0 or ahead.max() < 0:
        return slice(0, 0)
    first = int(np.argmax(ahead))
    return slice(first, first + int(ahead[first]) + 1)


def rows_between(rows: Rows, t: FloatArray, start: float, end: float) -> Rows:
    """Those of the rows whose time (s) lies in [start, end)."""
    return rows[(t[rows] >= start) & (t[rows] < end)]
