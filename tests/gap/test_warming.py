"""Thrust that falls within a flight is an effect, though each part of a flight has a scale of its own."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.acceptance import Judgement, judge
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.search.candidates import candidates_for
from calibration.gap.search.screen import screen
from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle, load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
LOSS, TIME = Variable("motor_warming", "loss"), Variable("motor_warming", "time_constant")
HIDDEN = {LOSS: 0.03, TIME: 8.0}


def with_effects(values: dict[Variable, float]) -> Vehicle:
    return Model(STOCK, values).vehicle()


@cache
def training(warming: bool) -> Training:
    """Seven flights of 24 s, each with a scale of thrust of its own."""
    rng = np.random.default_rng(3)
    paths = (circle(), up_and_down(), circle(period=3.0), up_and_down(period=2.0), circle(radius=0.4))
    records = []
    for n, path in enumerate((*paths, *paths[:2])):
        scale = Effect(
            name="thrust_scale", parameters={"scale": Quantity(rng.normal(1.0, 0.005), "1", 0.0, "hidden")}
        )
        hidden = with_effects(HIDDEN if warming else {})
        truth = dataclasses.replace(hidden, effects=(*hidden.effects, scale))
        record = fly(truth, path, 24.0, shape=f"shape {n % 5}", name=f"flight {n}", believed=STOCK)
        records.append(with_noise(record, 0.5, rng))
    return training_set(records, Model(STOCK))


def fitted(warming: bool) -> tuple[Fitted, Fitted, Judgement]:
    """Without the effect, with it, and what is to be thought of it."""
    flights = training(warming)
    none = refine(Model(STOCK), (), flights)
    found = refine(Model(STOCK), (LOSS, TIME), flights)
    return none, found, judge(none, found, (LOSS, TIME), flights, np.random.default_rng(1))


def fall(fit: Fitted) -> float:
    """How far the scales of the parts of a flight fall from the first to the last, on average."""
    scales = fit.estimate.fit.per_part[:, 0].reshape(-1, PARTS)
    return float((scales[:, 0] - scales[:, -1]).mean())


def test_a_fall_of_thrust_is_measured_and_left_to_no_nuisance() -> None:
    none, found, judgement = fitted(True)
    assert judgement.believed
    assert judgement.sizeable
    assert found.model.values[LOSS] == pytest.approx(HIDDEN[LOSS], rel=0.1)
    assert found.model.values[TIME] == pytest.approx(HIDDEN[TIME], rel=0.3)
    assert fall(none) > 0.01
    assert abs(fall(found)) < 0.002


def test_no_other_effect_promises_as_much() -> None:
    none, _, _ = fitted(True)
    first, *_ = screen(none, candidates_for(none, training(True)), training(True))
    assert first.candidate.effect == "motor_warming"


def test_scales_that_differ_between_flights_are_no_fall() -> None:
    _, found, judgement = fitted(False)
    assert not judgement.sizeable
    assert abs(found.model.values[LOSS]) < 0.003
