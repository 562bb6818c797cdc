"""Intervals hold where the truth follows another law, or each flight has a torque of its own."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.acceptance import NINETY_FIVE, clustered_errors
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.search.doubts import with_doubts
from calibration.gap.search.forward import LOG_TIMING
from calibration.gap.search.naming import is_another_law
from onboard.quantity import Quantity
from onboard.vehicle import Effect
from tests.gap.mujoco_flights import CALM, flights, frame
from tests.truth.airframe import nominal
from tests.truth.mujoco_room import Hidden

RATIO = Variable("motor_lag_asymmetry", "ratio")


def fitted(records: Sequence[FlightRecord], variable: Variable) -> tuple[Fitted, Training]:
    model = Model(nominal(frame(), "doubts"))
    training = training_set(records, model)
    return refine(model, (LOG_TIMING, variable), training), training


def test_rotors_whose_speed_follows_are_within_the_interval_of_a_lag(tmp_path: Path) -> None:
    """Equal constants up and down of the speed are unequal ones of the thrust."""
    records = flights(Hidden(), tmp_path, dataclasses.replace(CALM, speed_law=True))
    final, training = fitted(records, RATIO)
    chance = clustered_errors(final, training)
    found = final.model.change(RATIO)
    assert abs(found) > NINETY_FIVE * chance[RATIO]
    assert abs(found) < NINETY_FIVE * with_doubts(chance, final, training)[RATIO]


@pytest.mark.parametrize(("ratio", "speed_law"), [(1.0, True), (2.0, False)])
def test_a_lag_that_the_other_law_does_without_is_none(tmp_path: Path, ratio: float, speed_law: bool) -> None:
    """As strangers' rotors: equal in speed, they looked 1.3 times as quick to slow down."""
    lab = dataclasses.replace(CALM, speed_law=speed_law)
    final, training = fitted(flights(Hidden(lag_ratio=ratio), tmp_path, lab), RATIO)
    assert is_another_law([RATIO], final, training, clustered_errors(final, training)) is speed_law


def test_a_law_that_a_tachometer_told_is_not_doubted(tmp_path: Path) -> None:
    vehicle = nominal(frame(), "doubts")
    law = {"a_up": 15.0, "b_up": 1e-4, "a_down": 15.0, "b_down": 1e-4}
    units = {"a": "1/s", "b": "1/rad"}
    told = {key: Quantity(value, units[key[0]], 0.0, "test") for key, value in law.items()}
    known = Model(vehicle.with_effects([Effect(name="motor_speed_law", parameters=told)]))
    records = flights(Hidden(), tmp_path)
    for model, same in ((known, True), (Model(vehicle), False)):
        usual, by_speed = model.predict(records), model.predict_by_speed(records)
        assert np.array_equal(usual[:, :6], by_speed[:, :6]) is same


def test_what_moves_with_the_logs_timing_is_known_no_better_than_it(tmp_path: Path) -> None:
    """A delay and a lag that is shorter by as much tell the same."""
    lag = Variable("motor_lag", "scale")
    final, training = fitted(flights(Hidden(delay=0.012), tmp_path), lag)
    errors = with_doubts(clustered_errors(final, training), final, training)
    half = 0.5 * training.regression.signals.dt
    assert errors[LOG_TIMING] > half / np.sqrt(3.0)
    of_lag = half / final.model.base.motors.time_constant_up.value
    assert 0.3 * of_lag < errors[lag] < 1.5 * of_lag
