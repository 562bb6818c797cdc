"""A voltage decides about the battery alone, however its noise is modelled."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from calibration.gap.estimate.acceptance import judge
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, settled, training_set
from onboard.quantity import Quantity
from onboard.vehicle import Effect, load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
MASS, RESISTANCE = Variable("mass_error", "relative"), Variable("battery_sag", "resistance")


@cache
def training() -> Training:
    """Four flights of a vehicle that is 2 % too heavy, whose battery sags as no model of it does."""
    rng = np.random.default_rng(5)
    heavy = Effect(name="mass_error", parameters={"relative": Quantity(0.02, "1", 0.0, "hidden")})
    truth = dataclasses.replace(STOCK, effects=(heavy,))
    paths = (circle(), up_and_down(), circle(period=3.0), up_and_down(period=2.0))
    records = [
        with_noise(fly(truth, path, 12.0, shape=f"shape {n}", name=f"flight {n}", believed=STOCK), 0.5, rng)
        for n, path in enumerate(paths)
    ]
    return training_set(records, Model(STOCK))


def fitted(*variables: Variable) -> Fitted:
    return refine(Model(STOCK), variables, training())


def voltage_gain(fit: Fitted, over: Fitted) -> float:
    return float((fit.held_out - over.held_out)[-1].sum())


def test_a_fit_that_is_only_gone_on_with_gains_nothing() -> None:
    once = fitted(MASS)
    again = settled(settled(once, training()), training())
    assert abs(voltage_gain(again, once)) < 5.0  # though its noise was modelled anew, twice
    assert abs(float(again.gains(once, in_time=False).sum())) < 0.5


def test_a_mass_is_judged_by_forces() -> None:
    none, found = fitted(), fitted(MASS)
    assert abs(voltage_gain(found, none)) < 5.0  # a mass says nothing of it
    assert judge(none, found, [MASS], training(), np.random.default_rng(1)).significant
    assert found.model.values[MASS] == pytest.approx(0.02, abs=0.001)


def test_a_battery_is_judged_by_its_voltage() -> None:
    none = fitted()
    weak = refine(Model(STOCK, {RESISTANCE: 0.1}), (), training())
    gain = float(weak.gains(none, in_time=False).sum())
    assert gain == pytest.approx(float((weak.held_out - none.held_out).sum()))
    assert gain == pytest.approx(voltage_gain(weak, none), abs=0.5)
    assert abs(gain) > 15.0
