"""How good probabilities of body contact are: that hull or propellers touch the ceiling.

Only where a leg held does an outcome tell it (:mod:`onboard.outcome`): a failure may have touched or not. So
flights are scored that held, and by the share of those simulated landings that held, too. Brier score: mean
of (p - 1 or p - 0)^2, 0 to 1; always saying 0.5 gets 0.25.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.landings.outcomes.predict import Forecast
from calibration.gap.landings.outcomes.scores import (
    REPLICATES,
    Count,
    auc_interval,
    auc_of,
    base_rates,
    count_of,
    ended_alike,
    surprise,
)
from calibration.measurement import Interval, drawn_again, interval_of
from onboard.arrays import BoolArray, FloatArray, IntArray
from onboard.outcome import Outcome

_TOUCHED = {
    Outcome.FOUR_LEG: False,
    Outcome.FOUR_LEG_BODY_CONTACT: True,
    Outcome.TWO_LEG: False,
    Outcome.TWO_LEG_BODY_CONTACT: True,
}


@dataclass(frozen=True)
class ContactScore:
    """The scores of a set of flights.

    Attributes:
        flights: scored ones.
        brier, log_score: of the model; `_base_rate`: of the share of the other flights that touched.
        brier_gain: brier - brier_base_rate; None where all or none touched.
        brier_gain_ci95, log_score_ci95, auc_ci95: 95 %, flights drawn again.
        auc: probability that a flight that touched had a higher probability of it than one that did not; None
            where all or none touched.
        count: of the flights that touched.
    """

    flights: int
    brier: float
    brier_base_rate: float
    brier_gain: float | None
    brier_gain_ci95: Interval | None
    log_score: float
    log_score_ci95: Interval
    log_score_base_rate: float
    auc: float | None
    auc_ci95: Interval | None
    count: Count


def touched(outcome: Outcome | None) -> bool | None:
    """Whether the body touched; None where the outcome leaves it open."""
    return None if outcome is None else _TOUCHED.get(outcome)


def contact_score(
    forecasts: Sequence[Forecast], happened: Sequence[bool | None], least: int, rng: np.random.Generator
) -> ContactScore | None:
    """Score the flights of which body contact is known, and of which a simulated landing held.

    Args:
        forecasts: of the flights. happened: whether their bodies touched.
        least: fewer flights have no score.
        rng: draws flights.
    """
    pairs = [
        (one.body_contact_held, one.held, known)
        for one, known in zip(forecasts, happened, strict=True)
        if known is not None and one.body_contact_held is not None
    ]
    if len(pairs) < least:
        return None
    share, held = np.array([pair[0] for pair in pairs]), np.array([pair[1] for pair in pairs])
    return score_contact(share, np.array([pair[2] for pair in pairs]), held, rng)


def score_contact(
    probability: FloatArray, happened: BoolArray, draws: IntArray, rng: np.random.Generator
) -> ContactScore:
    """Score probabilities (n,) of contact, each from so many landings (n,), with what happened (n,)."""
    classes = happened.astype(np.int64)
    base = base_rates(classes, classes=2)
    own, by_base = (probability - happened) ** 2, (base[:, 1] - happened) ** 2
    gain = own - by_base
    both = np.column_stack([1.0 - probability, probability])
    surprises = surprise(both, classes, draws[:, None])
    drawn = drawn_again(happened.size, REPLICATES, rng)
    alike = ended_alike(classes)
    return ContactScore(
        flights=happened.size,
        brier=float(own.mean()),
        brier_base_rate=float(by_base.mean()),
        brier_gain=None if alike else float(gain.mean()),
        brier_gain_ci95=None if alike else interval_of(gain[drawn].mean(axis=1)),
        log_score=float(surprises.mean()),
        log_score_ci95=interval_of(surprises[drawn].mean(axis=1)),
        log_score_base_rate=float(surprise(base, classes, happened.size).mean()),
        auc=auc_of(probability, happened),
        auc_ci95=auc_interval(probability, happened, drawn),
        count=count_of(probability, happened),
    )
