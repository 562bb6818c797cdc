"""A steady wind about a kilogram-class vehicle, from a program that shares nothing with the finder."""

import math
from pathlib import Path

import pytest

from calibration.flights import open_flights
from calibration.gap.data.found_effect import Verdict
from calibration.gap.find import GapQuestion, GapResult, find_gap
from tests.truth import tunnel


def found_in(speed: float, seed: int, folder: Path) -> tuple[tunnel.Truth, GapResult]:
    truth = tunnel.draw(seed, speed)
    flights = open_flights(tunnel.make_flights(truth, seed, 5, folder))[0]
    return truth, find_gap(flights, GapQuestion(vehicle=tunnel.nominal(truth)))


@pytest.mark.soak  # a quarter of a minute; benchmarks/gap_wind.py judges eight such sets
def test_wind_is_named_with_direction_and_speed(tmp_path: Path) -> None:
    truth, found = found_in(6.0, 21, tmp_path)
    effects = {effect.name: effect for effect in found.report.effects}
    assert found.report.verdict is Verdict.EFFECTS_FOUND
    x, y = (effects["wind"].parameters[axis].value for axis in "xy")
    assert math.hypot(x, y) == pytest.approx(6.0, rel=0.25)
    turned = math.atan2(y, x) - math.atan2(truth.wind_y, truth.wind_x)
    assert abs(math.remainder(turned, 2.0 * math.pi)) < math.radians(10.0)
    levels = found.report.gap.overall
    assert levels.after < 0.15 * levels.before


@pytest.mark.soak
def test_calm_air_has_a_drag_and_no_wind(tmp_path: Path) -> None:
    _, found = found_in(0.0, 22, tmp_path)
    names = [effect.name for effect in found.report.effects]
    assert "wind" not in names
    assert any(name.endswith("_drag") for name in names)
