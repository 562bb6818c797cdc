"""How well two maps of landing rates agree, and how well they can.

A trial is so noisy that its repeats differ by 0.3 (docs/learning.md, Agreement): a map of the best of three
repeats agrees with a second one of the same simulation to a Spearman correlation of 0.5 to 0.7 only. More
repeats of ours, taken three at a time, remove our half of that noise.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import spearmanr

from onboard.arrays import FloatArray
from perchhw.learning.bands import best_per_condition
from perchhw.learning.errors import LearningInputError
from perchhw.learning.grid import Condition
from perchhw.learning.sweep_folder import Row


class Agreement(NamedTuple):
    """Of two maps over the conditions that both have.

    Attributes:
        spearman: rank correlation. mean_difference: mean absolute difference of the rates.
        conditions: how many.
        bias: mean of the first rate less the second.
        smoothed_spearman: rank correlation of the maps, each smoothed over its neighbours by
            :data:`SMOOTHING`: most of what single conditions differ by is the noise of a trial.
    """

    spearman: float
    mean_difference: float
    conditions: int
    bias: float
    smoothed_spearman: float


BEST_OF = 3
"""Repeats of a sweep, as the authors had."""

SMOOTHING = (0.15, 5.625)
"""m/s and deg, standard deviations of the kernel: one and a half steps of the grid."""


def agreement(ours: Mapping[Condition, float], theirs: Mapping[Condition, float]) -> Agreement:
    """How two maps of rates agree.

    Raises:
        LearningInputError: fewer than three conditions in common.
    """
    found = {_rounded(condition): rate for condition, rate in ours.items()}
    pairs = [
        (*key, found[key], rate)
        for condition, rate in theirs.items()
        if (key := _rounded(condition)) in found
    ]
    if len(pairs) < 3:
        raise LearningInputError(f"the maps have {len(pairs)} conditions in common: fly at least 3 of theirs")
    table = np.array(pairs)
    where, a, b = table[:, :2], table[:, 2], table[:, 3]
    return Agreement(
        spearman=_ranks(a, b),
        mean_difference=float(np.mean(np.abs(a - b))),
        conditions=len(pairs),
        bias=float(np.mean(a - b)),
        smoothed_spearman=_ranks(_smoothed(where, a), _smoothed(where, b)),
    )


def _ranks(a: FloatArray, b: FloatArray) -> float:
    return float(spearmanr(a, b).statistic)


def _smoothed(where: FloatArray, rates: FloatArray) -> FloatArray:
    """Kernel means of rates (n,) at their own conditions (n, 2)."""
    off = (where[:, None] - where) / np.array(SMOOTHING)
    weights = np.exp(-0.5 * np.sum(off**2, axis=2))
    return np.asarray(weights @ rates / weights.sum(axis=1))


def median_of_best(
    rows: Sequence[Row], repeats: int = BEST_OF, column: str = "landing_rate"
) -> dict[Condition, float]:
    """The best rate of `repeats` repeats at each condition: the median over all complete groups of them.

    Repeats 0, 1, 2 are a group, 3, 4, 5 the next: each has all starts of the search.

    Raises:
        LearningInputError: a condition has no complete group.
    """
    groups: defaultdict[Condition, defaultdict[int, list[float]]]
    groups = defaultdict(lambda: defaultdict(list))
    for row in rows:
        condition = Condition(float(row["speed_m_s"] or 0), float(row["angle_deg"] or 0))
        groups[condition][int(row["trial"] or 0) // repeats].append(float(row[column] or 0))
    best = {}
    for condition, of_condition in groups.items():
        complete = [max(rates) for rates in of_condition.values() if len(rates) == repeats]
        if not complete:
            raise LearningInputError(
                f"{condition.speed:g} m/s, {condition.angle_deg:g} deg: fewer than {repeats} repeats: "
                f"sweep with --repeats {repeats} or a multiple"
            )
        best[condition] = float(np.median(complete))
    return best


def agreement_of_sweeps(rows: Sequence[Row], theirs: Mapping[Condition, float]) -> dict[str, Any]:
    """Each sweep of :data:`BEST_OF` repeats alone, and the median of all, as JSON objects.

    Raises:
        LearningInputError: too few repeats or conditions.
    """
    both = median_of_best(rows, BEST_OF)
    sweeps = max(int(row["trial"] or 0) for row in rows) // BEST_OF + 1
    singles = [
        best_per_condition(tuple(row for row in rows if int(row["trial"] or 0) // BEST_OF == group))
        for group in range(sweeps)
    ]
    return {
        "single_sweeps": [agreement(single, theirs)._asdict() for single in singles],
        "median_of_sweeps": agreement(both, theirs)._asdict(),
    }


def _rounded(condition: Condition) -> tuple[float, float]:
    """The condition as the authors' tables write it, with two decimals."""
    return round(condition.speed, 2), round(condition.angle_deg, 2)
