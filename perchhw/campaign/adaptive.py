"""An adaptive campaign: the next attempt goes where it tells most about the map of the landing rate.

The choice follows from the seed and from the attempts that are done, so that a campaign goes on after a stop
as it would have gone on without one.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.arrays import FloatArray
from perchhw.attempt import Outcome
from perchhw.campaign.plan import CampaignPlan, Condition, Slot
from perchhw.campaign.rate_map import ExpectedRates, RateSurrogate
from perchhw.campaign.store import AttemptRow

_TIE = 1e-9


@dataclass(frozen=True)
class FlownMap:
    """What a campaign has found of the landing rate so far.

    Attributes:
        conditions: of its grid.
        flown, landed: attempts that ended by themselves, and those that landed on four legs, by condition.
        known: the map that they give.
    """

    conditions: tuple[Condition, ...]
    flown: tuple[int, ...]
    landed: tuple[int, ...]
    known: ExpectedRates


class AdaptiveOrder:
    """Chooses the attempts of one campaign."""

    def __init__(self, plan: CampaignPlan) -> None:
        self._plan = plan
        self._conditions = plan.conditions()
        self._surrogate = RateSurrogate(self._conditions)

    def next(self, rows: Sequence[AttemptRow]) -> Slot | None:
        """The attempt to fly after those in `rows`, or None when the campaign is done."""
        number = len({row.slot for row in rows})
        if number >= self._plan.most_attempts:
            return None
        known = self._surrogate.fit(*_counts(rows, self._conditions))
        if known.error <= self._plan.map_error:
            return None
        chosen = self._conditions[choose(known, np.random.default_rng([self._plan.seed, number]))]
        before = {row.slot for row in rows if row.place.condition == chosen}
        return Slot(number, *chosen, len(before) + 1)


def choose(known: ExpectedRates, rng: np.random.Generator) -> int:
    """Index of the condition where one more attempt lowers the map's error most; ties are drawn."""
    best = np.flatnonzero(known.gain >= known.gain.max() * (1.0 - _TIE))
    return int(rng.choice(best))


def flown_map(rows: Iterable[AttemptRow], conditions: Sequence[Condition]) -> FlownMap:
    """The map after `rows` over the grid of `conditions`."""
    landed, flown = _counts(rows, conditions)
    known = RateSurrogate(conditions).fit(landed, flown)
    return FlownMap(tuple(conditions), tuple(int(n) for n in flown), tuple(int(n) for n in landed), known)


def _counts(rows: Iterable[AttemptRow], conditions: Sequence[Condition]) -> tuple[FloatArray, FloatArray]:
    """Landings and attempts (n,) by condition; what was aborted says nothing of the rate."""
    flown: Counter[Condition] = Counter()
    landed: Counter[Condition] = Counter()
    for row in rows:
        if row.state == "done" and row.outcome not in (None, Outcome.ABORTED):
            flown[row.place.condition] += 1
            landed[row.place.condition] += row.outcome is Outcome.FOUR_LEG
    return np.array([landed[c] for c in conditions], float), np.array([flown[c] for c in conditions], float)
