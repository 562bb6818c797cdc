"""Which outcomes tell body contact, and how its probabilities are scored."""

import math
from dataclasses import replace

import numpy as np
import pytest

from calibration.gap.landings.outcomes.body_contact import contact_score, score_contact, touched
from calibration.gap.landings.outcomes.predict import Forecast
from calibration.gap.landings.outcomes.scores import REPLICATES, auc_of
from calibration.measurement import interval_of
from onboard.outcome import ATTACHED_OUTCOMES, Outcome

OUTCOMES = (
    Outcome.FOUR_LEG,
    Outcome.FOUR_LEG_BODY_CONTACT,
    Outcome.TWO_LEG_BODY_CONTACT,
    Outcome.TWO_LEG,
    Outcome.TWO_LEG,
    Outcome.FAILURE,
    None,
)
KNOWN = [touched(one) for one in OUTCOMES]


def predicted(contact: float | None, held: int = 100) -> Forecast:
    return Forecast("a flight", np.array([0.5, 0.3, 0.2]), 0.9, held, contact, None, None)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_only_an_outcome_that_held_tells() -> None:
    assert {one for one in Outcome if touched(one) is not None} == ATTACHED_OUTCOMES
    assert {one for one in Outcome if touched(one)} == {
        Outcome.FOUR_LEG_BODY_CONTACT,
        Outcome.TWO_LEG_BODY_CONTACT,
    }
    assert touched(None) is None


def test_the_score_is_that_of_the_flights_that_tell() -> None:
    """By hand: two of five touched, said with 0.2, 0.7, 0.4, 0.4, 0.1; each of 100 landings that held."""
    forecasts = [predicted(p) for p in (0.2, 0.7, 0.4, 0.4, 0.1, 0.99, 0.01)]
    found = contact_score(forecasts, KNOWN, 4, rng())
    assert found is not None
    assert (found.flights, found.count.real) == (5, 2)
    assert found.count.expected == pytest.approx(1.8)
    assert found.brier == pytest.approx((0.2**2 + 0.3**2 + 0.6**2 + 0.4**2 + 0.1**2) / 5)
    assert found.brier_base_rate == pytest.approx((3 * 0.5**2 + 2 * 0.75**2) / 5)
    assert found.brier_gain == pytest.approx(found.brier - found.brier_base_rate)
    smooth = [81 / 102, 71 / 102, 41 / 102, 61 / 102, 91 / 102]
    assert found.log_score == pytest.approx(-sum(map(math.log, smooth)) / 5)
    assert found.auc == pytest.approx((3 + 2.5) / 6)
    others = [*forecasts[:5], predicted(0.0), predicted(1.0)]
    assert contact_score(others, KNOWN, 4, rng()) == found


def test_a_flight_of_which_no_simulated_landing_held_is_left_out() -> None:
    forecasts = [predicted(0.3) for _ in KNOWN]
    forecasts[1] = predicted(None, held=0)
    found = contact_score(forecasts, KNOWN, 4, rng())
    assert found is not None
    assert (found.flights, found.count.real) == (4, 1)
    assert contact_score(forecasts, KNOWN, 5, rng()) is None


def test_few_landings_that_held_are_no_certainty() -> None:
    """Two of a hundred held and touched: the log score of a flight that did not is that of one in four."""
    found = contact_score([replace(predicted(1.0), held=2)] * 4, [False] * 4, 4, rng())
    assert found is not None
    assert found.log_score == pytest.approx(math.log(4.0))


def test_intervals_are_those_of_flights_drawn_again() -> None:
    said = np.array([0.2, 0.7, 0.4, 0.4, 0.1, 0.9, 0.3, 0.6])
    happened = np.array([False, True, True, False, False, True, False, False])
    found = score_contact(said, happened, np.full(8, 100), rng())
    drawn = rng().integers(0, 8, (REPLICATES, 8))
    areas = [auc_of(said[rows], happened[rows]) for rows in drawn]
    assert found.auc_ci95 == pytest.approx(interval_of(np.array([one for one in areas if one is not None])))
    surprises = -np.log((100.0 * np.where(happened, said, 1.0 - said) + 1.0) / 102.0)
    assert found.log_score_ci95 == pytest.approx(interval_of(surprises[drawn].mean(axis=1)))


def test_pairs_that_are_all_ranked_alike_claim_no_certainty() -> None:
    """Drawn again, such flights are ranked the same each time."""
    found = score_contact(np.array([0.1, 0.5, 0.6]), np.array([True, False, False]), np.full(3, 100), rng())
    assert found.auc == 0.0
    assert found.auc_ci95 is None


def test_flights_that_all_touched_rank_nothing() -> None:
    found = score_contact(np.full(4, 0.5), np.ones(4, dtype=np.bool_), np.full(4, 100), rng())
    assert found.auc is found.auc_ci95 is None
    assert found.brier_gain is found.brier_gain_ci95 is None
    assert found.brier == pytest.approx(0.25)
