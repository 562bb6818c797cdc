"""A voltage that follows its current late hides no resistance, and one that does not has no lag."""

import dataclasses

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import refine, training_set
from calibration.gap.estimate.voltage_lag import voltage_lag
from tests.gap.mujoco_flights import CALM, flights, frame
from tests.tiers import some
from tests.truth.airframe import nominal
from tests.truth.mujoco_room import Hidden

RESISTANCE, MOTOR_LAG = Variable("battery_sag", "resistance"), Variable("motor_lag", "scale")
MORE = 0.7 * frame().resistance
LATE = dataclasses.replace(CALM, battery_lag=0.2)
MODEL = Model(nominal(frame(), "late"))


def with_lag(records: tuple[FlightRecord, ...]) -> list[FlightRecord]:
    lag = voltage_lag(records, MODEL)
    return [dataclasses.replace(record, voltage_lag=lag) for record in records]


def test_a_voltage_is_late_as_a_first_order_is() -> None:
    record = dataclasses.replace(flights(Hidden())[0], voltage_lag=0.2)
    since = record.t - record.t[0]
    ramp = record.late_voltage(1.0 + since)
    np.testing.assert_allclose(ramp, 1.0 + since - 0.2 * (1.0 - np.exp(-since / 0.2)), atol=1e-9)


@pytest.mark.parametrize("hidden", some([Hidden(resistance=MORE), Hidden(), Hidden(lag_scale=0.7)], 3))
def test_the_lag_is_found_whatever_the_resistance(hidden: Hidden) -> None:
    assert voltage_lag(flights(hidden, LATE), MODEL) == pytest.approx(0.2, rel=0.02)


@pytest.mark.parametrize("hidden", some([Hidden(lag_scale=1.6), Hidden(resistance=MORE), Hidden()], 3))
def test_a_voltage_that_gives_way_at_once_has_none(hidden: Hidden) -> None:
    assert voltage_lag(flights(hidden), MODEL) == 0.0  # late thrusts are the motors', not the battery's


def test_a_lag_within_that_of_the_rotors_is_none() -> None:
    quick = dataclasses.replace(CALM, battery_lag=0.04)
    assert voltage_lag(flights(Hidden(resistance=MORE), quick), MODEL) == 0.0


def test_a_voltage_that_stands_still_has_none() -> None:
    records = [
        dataclasses.replace(record, voltage=np.full(record.t.size, 4.0)) for record in flights(Hidden())
    ]
    assert voltage_lag(records, MODEL) == 0.0
    unmeasured = [dataclasses.replace(record, voltage_measured=False) for record in records]
    assert voltage_lag(unmeasured, MODEL) == 0.0


@pytest.mark.parametrize("lag_scale", some([1.6, 1.0], 2))
def test_the_resistance_behind_a_lag_is_found(lag_scale: float) -> None:
    """Without the lag quick changes alone are heard, and say that the pack hardly gives way at all."""
    records = flights(Hidden(resistance=MORE, lag_scale=lag_scale), LATE)
    variables = (MOTOR_LAG, RESISTANCE) if lag_scale != 1.0 else (RESISTANCE,)
    found = refine(MODEL, variables, training_set(with_lag(records), MODEL))
    assert found.model.values[RESISTANCE] == pytest.approx(MORE, rel=0.02)
    at_once = refine(MODEL, variables, training_set(records, MODEL))
    assert at_once.model.start_value(RESISTANCE) < 0.1 * MORE
