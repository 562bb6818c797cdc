"""What the description of an effect tells the gap finder: confusions go both ways, sizes are sensible."""

import math

import pytest

from onboard.vehicle.effects import EFFECTS


@pytest.mark.parametrize("name", EFFECTS)
def test_a_confusion_is_known_to_both_effects(name: str) -> None:
    for other in EFFECTS[name].confused_with:
        assert other != name
        assert name in EFFECTS[other].confused_with, f"{other} must name {name} in confused_with"


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_that_exclude_each_other_are_confused_with_each_other(name: str) -> None:
    assert set(EFFECTS[name].excludes) <= set(EFFECTS[name].confused_with)


@pytest.mark.parametrize("name", EFFECTS)
def test_a_typical_vehicle_is_worth_a_name(name: str) -> None:
    for parameter in EFFECTS[name].parameters.values():
        assert parameter.practical_minimum > 0.0
        if parameter.neutral is None or math.isinf(parameter.neutral):
            assert parameter.practical_minimum < parameter.high - parameter.low
        else:
            size = abs(parameter.typical - parameter.neutral)
            assert size == 0.0 or parameter.practical_minimum <= size


@pytest.mark.parametrize("name", EFFECTS)
def test_it_is_said_what_reveals_an_effect(name: str) -> None:
    assert len(EFFECTS[name].revealed_by.split()) >= 3
