"""What to expect of the next flights: intervals that hold where the model is right, and where it is wrong."""

import numpy as np
import pytest

from calibration.gap.landings.outcomes.expectation import (
    LEAST_JUDGED,
    NEXT,
    ModelError,
    ModelErrorFileError,
    coverage,
    expect,
    judged_expectation,
    model_error,
)
from onboard.json_file import as_json
from tests.tiers import some


def flights(count: int, offset: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Simulated rates, and what happens where the logit of the real ones is off by `offset`."""
    rng = np.random.default_rng(seed)
    simulated = rng.uniform(0.1, 0.9, count)
    real = 1.0 / (1.0 + np.exp(-(np.log(simulated / (1.0 - simulated)) + offset)))
    return simulated, rng.random(count) < real


def test_a_model_that_is_right_keeps_its_rates_and_one_that_is_kind_loses_them() -> None:
    simulated, real = flights(400, 0.0, 1)
    right = model_error(simulated, real)
    assert right.mean[0] == pytest.approx(0.0, abs=3.0 * right.sigma[0])
    assert right.mean[1] == pytest.approx(1.0, abs=3.0 * right.sigma[1])
    simulated, real = flights(400, -2.0, 2)
    kind = model_error(simulated, real)
    assert kind.mean[0] == pytest.approx(-2.0, abs=3.0 * kind.sigma[0])
    rng = np.random.default_rng(0)
    promised = expect(kind, np.full(5, 0.8), rng)
    assert promised.ci95[0] < 0.35 < promised.ci95[1]  # logit 1.39 - 2
    assert promised.ci95[1] < 0.5


def test_few_flights_leave_a_wide_interval() -> None:
    simulated, real = flights(6, 0.0, 3)
    few = expect(model_error(simulated, real), simulated, np.random.default_rng(0))
    simulated, real = flights(100, 0.0, 3)
    many = expect(model_error(simulated, real), simulated, np.random.default_rng(0))
    assert few.ci95[1] - few.ci95[0] > 2.0 * (many.ci95[1] - many.ci95[0])
    low, high = many.four_leg_count80
    assert 0 <= low < many.four_leg_rate * NEXT < high <= NEXT


def test_how_often_intervals_hold_is_left_open_where_flights_are_few() -> None:
    few = judged_expectation(*flights(LEAST_JUDGED - 1, 0.0, 3), np.random.default_rng(0))
    assert few.coverage80 is few.coverage80_of_simulated_rates is None
    assert "left-out" not in few.words
    enough = judged_expectation(*flights(LEAST_JUDGED, 0.0, 3), np.random.default_rng(0))
    assert enough.coverage80 is not None
    assert f"in {100 * enough.coverage80:.0f} %" in enough.words


@pytest.mark.parametrize("offset", some([-2.0, 0.0], 2))
def test_counts_of_left_out_flights_lie_in_their_intervals(offset: float) -> None:
    """At least as often as promised, also where the simulated rates alone promise far too much."""
    found = [coverage(*flights(28, offset, seed), np.random.default_rng(0)) for seed in range(2)]
    inside, alone = np.mean(found, axis=0)
    assert inside >= 0.8
    assert alone < 0.5 if offset else alone >= 0.75


def test_attempts_that_do_not_flip_do_not_land() -> None:
    error = model_error(*flights(100, 0.0, 4))
    rng = np.random.default_rng(0)
    half = expect(error, np.full(5, 0.7), rng, np.full(5, 0.5))
    assert half.four_leg_rate == pytest.approx(
        0.5 * expect(error, np.full(5, 0.7), rng).four_leg_rate, abs=0.02
    )


def test_the_document_carries_the_error() -> None:
    simulated, real = flights(28, -1.0, 5)
    judged = as_json(judged_expectation(simulated, real, np.random.default_rng(0)))
    document = {"vehicle_sha256": "own", "expectation": judged, "improved": None}
    assert ModelError.from_document(document, "own", "landings.json") == model_error(simulated, real)
    with pytest.raises(ModelErrorFileError, match=r"landings.json: has no expectation.model_error"):
        ModelError.from_document({**document, "expectation": None}, "own", "landings.json")


def test_the_error_of_one_vehicle_is_none_of_another() -> None:
    """A document has that of the vehicle as it was filed, and of the one that was written."""
    kind, right = (
        as_json(judged_expectation(*flights(28, offset, 5), np.random.default_rng(0)))
        for offset in (-2.0, 0.0)
    )
    improved = {"vehicle_sha256": "written", "expectation": right}
    document = {"vehicle": "cf", "vehicle_sha256": "filed", "expectation": kind, "improved": improved}
    filed, written = (ModelError.from_document(document, one, "x") for one in ("filed", "written"))
    assert filed == model_error(*flights(28, -2.0, 5))
    assert written == model_error(*flights(28, 0.0, 5))
    for other in (document, {**document, "improved": None}, {"expectation": kind}):
        with pytest.raises(
            ModelErrorFileError, match=r"x: .* another vehicle \((cf|it does not say which)\)"
        ):
            ModelError.from_document(other, "third", "x")
