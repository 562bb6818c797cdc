"""Grids of approach conditions, and the random numbers of each."""

import math
from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from onboard.checked_arguments import checked_number
from perchhw.learning.errors import LearningInputError

VALUES_MOST = 1000
"""A range of more values than this is a slip of the pen."""


class Condition(NamedTuple):
    """One approach: commanded speed (m/s) and angle above the horizon (deg)."""

    speed: float
    angle_deg: float


def parse_range(text: str, option: str) -> tuple[float, ...]:
    """The values of ``FIRST:LAST:STEP`` (last included), ``A,B,C`` or ``A``.

    Raises:
        LearningInputError: the text is none of these, or means no value.
    """
    try:
        if ":" in text:
            first, last, step = _finite(text.split(":"))
            if not (step > 0.0 and last >= first):
                raise ValueError
            count = math.floor((last - first) / step + 1e-9) + 1
            if count > VALUES_MOST:
                raise ValueError
            return tuple(round(first + k * step, 9) for k in range(count))
        values = _finite(text.split(","))
    except (ValueError, OverflowError) as error:
        raise LearningInputError(
            f"{option} {text!r} is not a range: write FIRST:LAST:STEP with FIRST <= LAST and at most "
            f"{VALUES_MOST} values, or values as A,B,C"
        ) from error
    return values


def _finite(parts: Iterable[str]) -> tuple[float, ...]:
    values = tuple(map(float, parts))
    if not all(map(math.isfinite, values)):
        raise ValueError
    return values


def conditions(speeds: Iterable[float], angles: Iterable[float]) -> tuple[Condition, ...]:
    """All pairs of speed (m/s) and angle (deg), in this order.

    Raises:
        LearningInputError: a speed or angle that no approach can have, one that is given twice, or none at
            all.
        ArgumentError: one that is no number.
    """
    speeds = tuple(checked_number(speed, "speed") for speed in speeds)
    angles = tuple(checked_number(angle, "angle_deg") for angle in angles)
    for values, unit in ((speeds, "m/s"), (angles, "deg")):
        twice = [value for value, count in Counter(values).items() if count > 1]
        if twice:
            raise LearningInputError(f"{twice[0]:g} {unit} is given twice: name every value once")
    grid = tuple(Condition(speed, angle) for angle in angles for speed in speeds)
    for speed, angle in grid:
        if not 0.0 < speed <= 10.0:
            raise LearningInputError(f"a speed of {speed:g} m/s makes no approach: give 0 < speed <= 10")
        if not 0.0 < angle <= 90.0:
            raise LearningInputError(f"an angle of {angle:g} deg makes no approach: give 0 < angle <= 90")
    if not grid:
        raise LearningInputError("the grid has no condition: give at least one speed and one angle")
    return grid


def generator(seed: int, purpose: int, condition: Condition, repeat: int = 0) -> np.random.Generator:
    """The generator of one task.

    It depends on the seed, the purpose and the condition alone: not on the grid, the order of work or the
    number of workers.
    """
    key = (purpose, round(condition.speed * 1e6), round(condition.angle_deg * 1e6), repeat)
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))
