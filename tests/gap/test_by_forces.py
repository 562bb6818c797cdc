"""Forces alone decide about a drag, whatever torques go with the motion."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from calibration.gap.data.signals import TORQUE
from calibration.gap.estimate.acceptance import judge
from calibration.gap.estimate.model import Model, Variable, kinds_that_tell
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.search.beside import gain_where
from calibration.gap.search.candidates import Candidate
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
INFLOW, DAMPING = Variable("inflow_thrust_loss", "coefficient"), Variable("rate_damping", "x")
HIDDEN = 1.4e-6


@cache
def training() -> Training:
    """Four flights that lose thrust by climbing, and feel ten times the damping that comes with it."""
    rng = np.random.default_rng(5)
    damping = {DAMPING._replace(parameter=axis): 6e-5 for axis in "xy"}
    truth = Model(STOCK, {INFLOW: HIDDEN, **damping}).vehicle()
    paths = (circle(), up_and_down(), circle(period=3.0), up_and_down(period=2.0))
    records = [
        with_noise(fly(truth, path, 12.0, shape=f"shape {n}", name=f"{n}", believed=STOCK), 0.5, rng)
        for n, path in enumerate(paths)
    ]
    return training_set(records, Model(STOCK))


def fitted(*variables: Variable) -> Fitted:
    return refine(Model(STOCK), variables, training())


def test_a_loss_of_thrust_is_measured_though_torques_say_ten_times_as_much() -> None:
    none, found = fitted(), fitted(INFLOW)
    judgement = judge(none, found, [INFLOW], training(), np.random.default_rng(1))
    assert found.model.values[INFLOW] == pytest.approx(HIDDEN, rel=0.03)
    assert judgement.errors[INFLOW] < 0.1 * HIDDEN
    assert judgement.significant
    assert not judgement.at_bound


def test_what_torques_gain_by_it_does_not_count() -> None:
    none, found = fitted(), fitted(INFLOW)
    forces, torques, _ = (found.held_out - none.held_out).sum(axis=1)
    assert abs(torques) > 15.0  # enough for a name
    assert float(found.gains(none, in_time=False).sum()) == pytest.approx(forces)


def test_a_damping_is_told_by_torques() -> None:
    model = Model(STOCK)
    predicted = model.predict(training().records)
    assert np.any(model.derivative(training().records, DAMPING, predicted)[:, TORQUE])
    assert not np.any(model.derivative(training().records, INFLOW, predicted)[:, TORQUE])
    assert kinds_that_tell({"inflow_thrust_loss", "rate_damping"}) == [0, 1]


def test_two_fits_without_a_different_effect_are_compared_by_forces_and_torques() -> None:
    one = fitted(INFLOW)
    other = dataclasses.replace(one, held_out=one.held_out + np.array([[1.0], [2.0], [4.0]]))
    assert float(other.gains(one, in_time=False)[0]) == 3.0


def test_a_torque_that_is_not_believed_keeps_no_force_from_its_name() -> None:
    none, damped = fitted(), fitted(DAMPING)
    inflow, damping = (Candidate(v.effect, (v,), (none.model,)) for v in (INFLOW, DAMPING))
    assert gain_where(damping, (damping, damped), none) > 100.0
    assert abs(gain_where(inflow, (damping, damped), none)) < 5.0
    assert gain_where(inflow, (inflow, fitted(INFLOW)), none) > 100.0
