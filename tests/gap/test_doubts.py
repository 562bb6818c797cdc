"""Intervals hold where the truth follows another law, or each flight has a torque of its own."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.acceptance import DETECTABLE, NINETY_FIVE, clustered_errors
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.search.always import LOG_TIMING
from calibration.gap.search.doubts import with_doubts
from calibration.gap.search.naming import there_without_delay
from onboard.vehicle import load_vehicle
from tests.gap.mujoco_flights import CALM, flights, frame
from tests.gap.simulated_flight import fly, up_and_down, with_noise
from tests.tiers import some
from tests.truth.airframe import nominal
from tests.truth.mujoco_room import Hidden, faces_of

RATIO = Variable("motor_lag_asymmetry", "ratio")
MASS, SCALE = (Variable("mass_error", "relative"),), (Variable("thrust_scale", "scale"),)
MOTORS = tuple(Variable("motor_imbalance", motor) for motor in ("m1", "m2", "m3", "m4"))


def fitted(records: Sequence[FlightRecord], variable: Variable) -> tuple[Fitted, Training]:
    model = Model(nominal(frame(), "doubts"))
    training = training_set(records, model)
    return refine(model, (LOG_TIMING, variable), training), training


@pytest.mark.parametrize(("ratio", "speed_law"), some([(1.0, True), (2.0, False)], 2))
def test_a_lag_that_another_law_does_without_is_none(ratio: float, speed_law: bool) -> None:
    """As strangers' rotors: equal in speed, they looked 1.3 times as quick to slow down."""
    lab = dataclasses.replace(CALM, speed_law=speed_law)
    final, training = fitted(flights(Hidden(lag_ratio=ratio), lab), RATIO)
    errors = with_doubts(clustered_errors(final, training), final, training)
    assert (abs(final.model.change(RATIO)) < NINETY_FIVE * errors[RATIO]) is speed_law


@pytest.mark.further
def test_an_area_is_known_no_better_than_the_law_of_its_drag() -> None:
    """MuJoCo's bodies are dragged by the square of each component, ours by the speed: see how each area is
    found, and that its interval holds the one that flew."""
    hidden = Hidden(area=0.03)
    model = Model(nominal(frame(), "doubts"))
    training = training_set(flights(hidden), model)
    areas = tuple(Variable("body_drag", f"area_{axis}") for axis in "xyz")
    final = refine(model, (LOG_TIMING, *areas), training)
    chance = clustered_errors(final, training)
    errors = with_doubts(chance, final, training)
    flown = hidden.area * faces_of(frame(), hidden)
    for area, true in zip(areas, flown, strict=True):
        short = true - final.model.start_value(area)
        assert short > 0.0
        assert short < NINETY_FIVE * errors[area]
    assert flown[2] - final.model.start_value(areas[2]) > NINETY_FIVE * chance[areas[2]]


@pytest.mark.further
def test_what_moves_with_the_logs_timing_is_known_no_better_than_it() -> None:
    """A delay and a lag that is shorter by as much tell the same."""
    lag = Variable("motor_lag", "scale")
    final, training = fitted(flights(Hidden(delay=0.012)), lag)
    errors = with_doubts(clustered_errors(final, training), final, training)
    half = 0.5 * training.regression.signals.dt
    assert errors[LOG_TIMING] > half / np.sqrt(3.0)
    of_lag = half / final.model.base.motors.time_constant_up.value
    assert 0.3 * of_lag < errors[lag] < 1.5 * of_lag


@pytest.mark.parametrize(("delay", "there"), [(0.004, False), (0.0, True)])
def test_what_needs_a_delay_shorter_than_half_an_interval_is_not_there(delay: float, there: bool) -> None:
    """Motors that are quicker by as much as commands are late; and motors that are quicker."""
    lag = Variable("motor_lag", "scale")
    quicker = 0.004 / nominal(frame(), "doubts").motors.time_constant_up.value
    final, training = fitted(flights(Hidden(delay=delay, lag_scale=1.0 - quicker)), lag)
    chance = clustered_errors(final, training)
    assert final.model.change(lag) < -DETECTABLE * chance[lag]
    assert there_without_delay([lag], final, training, chance) is there


@pytest.mark.parametrize(
    ("variables", "hidden", "true"),
    some(
        [
            (MASS, Hidden(mass=-0.06), (-0.06,)),
            (MOTORS, Hidden(motors=(0.95, 1.0, 1.0, 1.0)), (-0.05, 0.0, 0.0, 0.0)),
            (SCALE, Hidden(thrust_scale=0.93), (-0.07,)),
        ],
        1,
    ),
)
def test_what_lifts_the_vehicle_is_known_whenever_its_commands_arrive(
    variables: tuple[Variable, ...], hidden: Hidden, true: tuple[float, ...]
) -> None:
    """Half an interval of a log of 50 Hz once left a mass open by 0.38: all thrusts made up for it."""
    slow = dataclasses.replace(CALM, per_line=20, accelerometer=False)
    model = Model(nominal(frame(), "doubts"))
    training = training_set(flights(hidden, slow), model)
    final = refine(model, variables, training)
    errors = with_doubts(clustered_errors(final, training), final, training)
    for variable, value in zip(variables, true, strict=True):
        assert errors[variable] < 0.015
        assert final.model.change(variable) == pytest.approx(value, abs=NINETY_FIVE * errors[variable])


def drawing_for_lift(record: FlightRecord, flown: Model, rng: np.random.Generator) -> FlightRecord:
    """The flight with a battery whose motors draw for what they lift; they get the same voltage as before."""
    voltage = flown.voltage_for_lift([record])
    duty = record.duty * (record.known_voltage / voltage)[:, None]
    measured = voltage + 2e-3 * rng.standard_normal(voltage.size)
    return dataclasses.replace(record, duty=duty, voltage=measured)


def test_a_resistance_is_known_no_better_than_what_bent_motors_draw() -> None:
    curve, resistance = Variable("thrust_curve", "curvature"), Variable("battery_sag", "resistance")
    stock, rng = load_vehicle("crazyflie21-stock"), np.random.default_rng(3)
    truth = Model(stock).with_values({curve: 0.15})
    records = []
    for n, period in enumerate((1.5, 1.8, 2.1, 2.5)):
        record = fly(truth.vehicle(), up_and_down(0.5, period), name=f"flight {n}", believed=stock)
        records.append(with_noise(drawing_for_lift(record, truth, rng), 0.5, rng))
    training = training_set(records, Model(stock))
    final = refine(Model(stock), (LOG_TIMING, curve, resistance), training)
    chance = clustered_errors(final, training)
    errors = with_doubts(chance, final, training)
    false = abs(final.model.change(resistance))
    assert NINETY_FIVE * chance[resistance] < false < NINETY_FIVE * errors[resistance]
    assert abs(final.model.change(curve) - 0.15) < NINETY_FIVE * errors[curve]
