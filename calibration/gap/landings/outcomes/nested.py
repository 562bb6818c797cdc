"""How good a search over outcomes is as a whole: it chooses its model anew without the flights that are
predicted.

The score of the best model is a little too kind, since the flights that judge it chose it among the others.
Here each flight is predicted by the model that the search takes for the best where it has the other flights
alone, with the vehicles that these leave: nested cross-validation (Varma and Simon, BMC Bioinformatics 7, 91,
2006). Halves likewise. The table of predictions is that of the search, and nothing is simulated again.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.gap.landings.outcomes.held_out import HalfScore, half_score, held_out, left_one_out
from calibration.gap.landings.outcomes.scores import REPLICATES, Score, brier, score, surprise
from calibration.gap.landings.outcomes.search import (
    MODELS,
    OutcomeSearch,
    logs_of,
    model_name,
    open_vehicles,
    select,
)
from calibration.gap.landings.outcomes.vehicles import WITHOUT, Point
from calibration.measurement import drawn_again
from onboard.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class NestedScore:
    """Score of flights that had no part in the choice of the model either.

    Attributes:
        left_one_out: of each flight from the others. left_out: what was said of it (n, 3).
        halves: of each half from the other. halves_of_best: of the search's best model, on the same halves.
        chosen: models that were chosen without a flight, and without how many. chosen_by_halves: likewise.
    """

    left_one_out: Score
    left_out: FloatArray
    halves: HalfScore
    halves_of_best: HalfScore
    chosen: dict[str, int]
    chosen_by_halves: dict[str, int]

    def json_shape(self) -> dict[str, Any]:
        """``search.nested`` of the document."""
        return {key: value for key, value in vars(self).items() if key != "left_out"}


def nested_score(
    search: OutcomeSearch, points: Sequence[Point], table: FloatArray, real: IntArray, draws: int,
    rng: np.random.Generator, filed: Point = WITHOUT,
) -> NestedScore:  # fmt: skip
    """Score a search.

    Args:
        search: what it found. points, table, real, draws, filed: as it was given them.
        rng: draws flights and halves.
    """
    logs = logs_of(table, real, draws)
    vehicles = [open_vehicles(groups, filed, np.array(points)) for groups in MODELS]
    tables = [(table[rows], logs[rows]) for rows in vehicles]

    def best(known: BoolArray) -> int:
        drawn = drawn_again(int(known.sum()), REPLICATES, rng)
        return _best([(own[:, known], its[:, known]) for own, its in tables], real[known], draws, drawn)

    each = np.eye(real.size, dtype=np.bool_)
    without = [best(~own) for own in each]
    left = np.array(
        [held_out(*tables[model], real, own)[0][0] for model, own in zip(without, each, strict=True)]
    )
    by_halves: list[int] = []

    def predict(own: BoolArray) -> tuple[FloatArray, list[bool]]:
        by_halves.append(best(~own))
        return held_out(*tables[by_halves[-1]], real, own)

    overall = tables[MODELS.index(search.best.groups)]
    seed = rng.integers(2**32)  # the same halves for both
    return NestedScore(
        left_one_out=score(left, real, draws, rng),
        left_out=left,
        halves=half_score(real, predict, np.random.default_rng(seed)),
        halves_of_best=half_score(
            real, lambda own: held_out(*overall, real, own), np.random.default_rng(seed)
        ),
        chosen=_counted(without),
        chosen_by_halves=_counted(by_halves),
    )


def _best(
    tables: Sequence[tuple[FloatArray, FloatArray]], real: IntArray, draws: int, drawn: IntArray
) -> int:
    """Index of the model that a search takes for the best, as :func:`..search.search_outcomes` does.

    Args:
        tables: by model, what its vehicles predict (points, n, 3), and ln p of what happened (points, n).
        real: classes (n,). draws: landings behind each probability. drawn: sets of flights (sets, n).
    """
    said = [left_one_out(*one) for one in tables]
    log_scores = np.array([surprise(one, real, draws).mean() for one in said])
    return select(log_scores, np.array([brier(one, real) for one in said]), drawn).best


def _counted(models: Sequence[int]) -> dict[str, int]:
    """How often each model was chosen, the most frequent first."""
    return {model_name(MODELS[model]): count for model, count in Counter(models).most_common()}
