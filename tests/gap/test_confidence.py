"""The probability of a name is what became of names as clear as it is, no less for a clearer one."""

import dataclasses
from collections.abc import Sequence

import pytest

from calibration.gap.data.found_effect import FoundEffect, FoundParameter
from calibration.gap.report.confidence import (
    BESIDE_A_GAP,
    COUNTED,
    Counted,
    clearness,
    probability,
    with_probability,
)
from onboard.quantity import Quantity
from onboard.vehicle import Effect, load_vehicle

STOCK = load_vehicle("crazyflie21-stock")


def found(value: float, half: float) -> FoundEffect:
    """A scale of thrust, give or take so much in 95 %."""
    parameter = FoundParameter(value=value, unit="1", ci95=(value - half, value + half))
    return FoundEffect(
        name="thrust_scale",
        parameters={"scale": parameter},
        error_before=0.5,
        error_after=0.1,
        improvement_ci95=(0.3, 0.5),
    )


def test_a_name_is_as_clear_as_its_number_is_far_from_nothing() -> None:
    assert clearness(found(0.9, 1.96 * 0.02), STOCK) == pytest.approx(5.0)
    assert clearness(found(1.1, 1.96 * 0.02), STOCK) == pytest.approx(5.0)


def test_what_the_vehicle_file_says_already_is_nothing() -> None:
    filed = Effect(name="thrust_scale", parameters={"scale": Quantity(0.88, "1", 0.01, "bench")})
    vehicle = dataclasses.replace(STOCK, effects=(filed,))
    assert clearness(found(0.9, 1.96 * 0.02), vehicle) == pytest.approx(1.0)


@pytest.mark.parametrize(("like", "explained"), [(COUNTED, True), (BESIDE_A_GAP, False)])
def test_a_clearer_name_is_no_less_probable_and_none_is_certain(
    like: Sequence[Counted], explained: bool
) -> None:
    levels = [probability(counted.least, explained) for counted in like]
    assert levels == sorted(levels)
    assert all(0.0 < level < 1.0 for level in levels)
    assert probability(1e9, explained) == levels[-1]


@pytest.mark.parametrize("clear", [1.0, 4.1, 11.8, 40.0])
def test_a_name_beside_a_gap_that_it_does_not_explain_is_less_sure(clear: float) -> None:
    assert probability(clear, False) < probability(clear, True)


def test_each_effect_of_a_report_has_its_probability() -> None:
    weak, strong = with_probability([found(0.99, 0.01), found(0.7, 0.01)], STOCK, True)
    assert weak.probability is not None
    assert strong.probability is not None
    assert weak.probability <= strong.probability
