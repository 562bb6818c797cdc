"""Teacher forcing says of a flight what the simulation did, and of an effect what it changes."""

import dataclasses

import numpy as np
import pytest

from calibration.gap.data.signals import FORCE, TORQUE, VOLTAGE, Signals, stack_signals
from calibration.gap.estimate.model import Model, Variable
from onboard.quantity import Quantity
from onboard.vehicle import EFFECTS, Effect, Vehicle, load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down

STOCK = load_vehicle("crazyflie21-stock")
SIZES = {
    "thrust_scale": {"scale": 0.92},
    "motor_lag": {"scale": 1.5},
    "motor_warming": {"loss": 0.1, "time_constant": 4.0},
    "rotor_drag": {"coefficient": 1.5e-6},
    "com_offset": {"x": 0.002, "y": -0.001},
    "velocity_moment": {"roll": 2e-4, "pitch": 2e-4},
    "inertia_error": {"xx": 0.2, "yy": 0.2, "zz": 0.2},
    "command_delay": {"delay": 0.012},
    "mass_error": {"relative": 0.05},
}


def with_effect(name: str, values: dict[str, float]) -> Vehicle:
    parameters = {
        key: Quantity(value, EFFECTS[name].parameters[key].unit, 0.0, "test") for key, value in values.items()
    }
    return dataclasses.replace(STOCK, effects=(Effect(name=name, parameters=parameters),))


def error(signals: Signals, predicted: np.ndarray) -> np.ndarray:
    left = np.where(signals.valid, signals.measured - predicted, 0.0)
    return np.array([np.sqrt(np.mean(left[:, part] ** 2)) for part in (FORCE, TORQUE)])


@pytest.mark.parametrize("name", SIZES)
def test_the_true_model_predicts_its_own_flight_and_another_does_not(name: str) -> None:
    truth = with_effect(name, SIZES[name])
    records = [fly(truth, circle(), 8.0), fly(truth, up_and_down(), 8.0)]
    signals = stack_signals(records)
    right = error(signals, Model(truth).predict(records))
    wrong = error(signals, Model(STOCK).predict(records))
    assert right[0] < 0.02
    assert right[1] < 0.6
    assert np.max(wrong / right) > 4.0


def test_the_derivative_is_what_a_small_change_does() -> None:
    records = [fly(STOCK, circle(), 6.0)]
    model = Model(STOCK)
    predicted = model.predict(records)
    for variable, size in (
        (Variable("thrust_scale", "scale"), 0.01),
        (Variable("rotor_drag", "coefficient"), 2e-7),
        (Variable("motor_lag", "scale"), 0.01),
        (Variable("com_offset", "x"), 1e-4),
    ):
        start = model.start_value(variable)
        changed = model.with_values({variable: start + size}).predict(records)
        change = size * model.response(records, variable, predicted)
        told = FORCE if EFFECTS[variable.effect].by_forces else slice(0, 6)
        rows = slice(60, None), told
        tolerance = 0.03 * np.abs(change[rows]).max()
        np.testing.assert_allclose((changed - predicted)[rows], change[rows], atol=tolerance)


def test_values_stay_within_what_is_physical() -> None:
    variable = Variable("rotor_drag", "coefficient")
    assert Model(STOCK).with_values({variable: -1.0}).values[variable] == Model(STOCK).rule(variable).low
    assert Model(STOCK).with_values({variable: 1.0}).values[variable] == Model(STOCK).rule(variable).high


def test_rows_after_a_loss_of_commands_are_not_judged_until_the_motors_are_known_again() -> None:
    record = fly(STOCK, circle(), 6.0)
    known = record.motors_known.copy()
    known[200:210] = False
    signals = stack_signals([dataclasses.replace(record, motors_known=known)])
    assert not signals.valid[200:240, FORCE].any()
    assert signals.valid[245:300, FORCE].all()
    assert signals.valid[100:200, FORCE].all()


def test_a_torque_is_not_predicted_from_a_rate_that_is_measured_after_it() -> None:
    record = fly(with_effect("rate_damping", {"x": 5e-5, "y": 5e-5, "z": 5e-5}), circle(), 4.0)
    model = Model(with_effect("rate_damping", {"x": 5e-5, "y": 5e-5, "z": 5e-5}))
    noisy = record.rate.copy()
    noisy[200] += 0.5
    plain = model.predict([record])[:, TORQUE]
    change = np.abs(model.predict([dataclasses.replace(record, rate=noisy)])[:, TORQUE] - plain).max(axis=1)
    assert change[:200].max() == 0.0
    assert change[200] > 1.0


def test_a_voltage_decides_about_the_battery_alone() -> None:
    records = [fly(STOCK, up_and_down(), 4.0)]
    model = Model(STOCK)
    plain = model.predict(records)
    curved = model.with_values({Variable("thrust_curve", "curvature"): 0.1}).predict(records)
    np.testing.assert_array_equal(curved[:, VOLTAGE], plain[:, VOLTAGE])
    cold = model.with_values({Variable("motor_warming", "loss"): 0.1}).predict(records)
    np.testing.assert_array_equal(cold[:, VOLTAGE], plain[:, VOLTAGE])
    assert np.abs(cold[:, FORCE] - plain[:, FORCE]).max() > 0.1
    assert np.abs(curved[:, FORCE] - plain[:, FORCE]).max() > 0.1
    scale = model.derivative(records, Variable("thrust_scale", "scale"), plain)
    assert np.all(scale[:, VOLTAGE] == 0.0)
    sag = model.derivative(records, Variable("battery_sag", "resistance"), plain)
    assert np.all(sag[:, :VOLTAGE] == 0.0)
    assert -12.0 < np.mean(sag[:, VOLTAGE]) < -1.0  # V per ohm: the current
