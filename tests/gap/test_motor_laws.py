"""Flights tell by which law rotors follow, so that no name stands in for it."""

import dataclasses
import math
import re
from collections.abc import Sequence

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.motor_laws import motor_laws
from calibration.gap.estimate.refine import refine, training_set
from calibration.gap.estimate.unstated import AXES
from calibration.gap.search.always import LOG_TIMING, law_in_words
from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle
from tests.gap.mujoco_flights import CALM, flights, frame
from tests.tiers import some
from tests.truth.airframe import nominal
from tests.truth.mujoco_room import Hidden

VEHICLE = nominal(frame(), "laws")


def with_law(vehicle: Vehicle, up: tuple[float, float], down: tuple[float, float]) -> Vehicle:
    """The vehicle whose file has a law of the rotors' speed: a (1/s) and b (1/rad), up and down."""
    values = dict(zip(("a_up", "b_up", "a_down", "b_down"), (*up, *down), strict=True))
    units = {"a": "1/s", "b": "1/rad"}
    told = {key: Quantity(value, units[key[0]], 0.0, "test") for key, value in values.items()}
    return vehicle.with_effects([Effect(name="motor_speed_law", parameters=told)])


def laws_of(model: Model, records: Sequence[FlightRecord]) -> tuple[np.ndarray, ...]:
    return motor_laws(model, records, model.motion(records, model.parameters()))


@pytest.mark.parametrize("speed_law", some([True, False], 2))
def test_flights_tell_the_law(speed_law: bool) -> None:
    """MuJoCo's rotors follow by their speed, or by their thrust."""
    records = flights(Hidden(), dataclasses.replace(CALM, speed_law=speed_law))
    model = Model(VEHICLE)
    fit = refine(model, (LOG_TIMING,), training_set(records, model))
    by_speed, *others = fit.estimate.fit.theta[len(fit.variables) + AXES : fit.first_unnamed]
    assert by_speed == pytest.approx(float(speed_law), abs=0.15)
    assert np.abs(others).max() < 0.15
    told = [words.startswith("rotors follow by their speed in first order") for words in law_in_words(fit)]
    assert told == ([True] if speed_law else [])


def test_more_than_the_whole_of_a_law_is_another_law() -> None:
    """Strangers read that rotors follow by their speed "1193 %"."""
    records = flights(Hidden(), dataclasses.replace(CALM, speed_law=True))
    model = Model(VEHICLE)
    fit = refine(model, (LOG_TIMING,), training_set(records, model))
    found = dataclasses.replace(fit.estimate.fit, theta=3.0 * fit.estimate.fit.theta)
    (words,) = law_in_words(dataclasses.replace(fit, estimate=dataclasses.replace(fit.estimate, fit=found)))
    assert "%" not in words
    assert re.search(r"or by a law that differs (2\.[6-9]|3\.[0-5]) times as much", words)


@pytest.mark.further
def test_a_law_that_a_tachometer_told_is_not_asked_about() -> None:
    known = Model(with_law(VEHICLE, (15.0, 1e-4), (15.0, 1e-4)))
    records = flights(Hidden())
    assert laws_of(known, records) == ()


def test_each_law_is_that_of_a_vehicle_file() -> None:
    """As quick near hover as the thrusts; a file has no rotor without any drag."""
    records = flights(Hidden())
    motors = VEHICLE.motors
    assert motors.thrust_coefficient is not None
    hover = math.sqrt(0.25 * VEHICLE.body.mass.value * 9.81 / motors.thrust_coefficient.value)
    lags = (motors.time_constant_up.value, motors.time_constant_down.value)
    speed = [(1.0 / lag, 1e-5) for lag in lags]
    drag = [(0.0, 0.5 / lag / hover) for lag in lags]
    usual = Model(VEHICLE).predict(records)
    added = laws_of(Model(VEHICLE), records)
    for law, (up, down) in zip(added, (tuple(speed), tuple(drag), (speed[0], drag[1])), strict=True):
        filed = Model(with_law(VEHICLE, up, down)).predict(records)
        left = (filed - usual - law)[:, :6]
        assert np.sqrt(np.mean(left**2)) < 0.1 * np.sqrt(np.mean(law[:, :6] ** 2))


def test_ratios_of_speeds_alone_count() -> None:
    """A vehicle file without a thrust coefficient says nothing of speeds."""
    records = flights(Hidden())
    without = dataclasses.replace(
        VEHICLE, motors=dataclasses.replace(VEHICLE.motors, thrust_coefficient=None)
    )
    for one, other in zip(laws_of(Model(VEHICLE), records), laws_of(Model(without), records), strict=True):
        assert np.allclose(one, other, atol=1e-6 * np.abs(one).max())
