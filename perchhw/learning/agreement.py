"""How well two maps of landing rates agree, and how well they can.

A trial is so noisy that its repeats differ by 0.3 (docs/learning.md, Agreement): a map of the best of three
repeats agrees with a second one of the same simulation to a Spearman correlation of 0.5 to 0.7 only. More
repeats of ours, taken three at a time, remove our half of that noise.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import spearmanr

from perchhw.learning.errors import LearningInputError
from perchhw.learning.grid import Condition
from perchhw.learning.sweep_folder import Row


class Agreement(NamedTuple):
    """Of two maps over the conditions that both have.

    Attributes:
        spearman: rank correlation. mean_difference: mean absolute difference of the rates.
        conditions: how many.
    """

    spearman: float
    mean_difference: float
    conditions: int


def agreement(ours: Mapping[Condition, float], theirs: Mapping[Condition, float]) -> Agreement:
    """Rank correlation and mean absolute difference of two maps of rates.

    Raises:
        LearningInputError: fewer than three conditions in common.
    """
    found = {_rounded(condition): rate for condition, rate in ours.items()}
    pairs = [
        (found[key], rate) for condition, rate in theirs.items() if (key := _rounded(condition)) in found
    ]
    if len(pairs) < 3:
        raise LearningInputError(f"the maps have {len(pairs)} conditions in common: fly at least 3 of theirs")
    a, b = np.array(pairs).T
    return Agreement(float(spearmanr(a, b).statistic), float(np.mean(np.abs(a - b))), len(pairs))


def median_of_best(
    rows: Sequence[Row], repeats: int = 3, column: str = "landing_rate"
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


def _rounded(condition: Condition) -> tuple[float, float]:
    """The condition as the authors' tables write it, with two decimals."""
    return round(condition.speed, 2), round(condition.angle_deg, 2)
