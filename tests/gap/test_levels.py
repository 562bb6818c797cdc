"""A weight that is wrong in all flights is an effect; one that differs between flights is a nuisance."""

import dataclasses

import numpy as np
import pytest

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.acceptance import Judgement, judge
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.nuisances import NUISANCES
from calibration.gap.estimate.refine import Fitted, refine, training_set
from onboard.quantity import Quantity
from onboard.vehicle import Effect, load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
MASS = Variable("mass_error", "relative")


def fitted(mass: float, scales: list[float]) -> tuple[Fitted, Fitted, Judgement]:
    """Flights of one mass error and these scales of thrust: without the effect, with it, its judgement."""
    rng = np.random.default_rng(5)
    paths = (circle(), up_and_down(), circle(period=3.0), up_and_down(period=2.0))
    records = []
    for n, scale in enumerate(scales):
        values = {"mass_error": ("relative", mass), "thrust_scale": ("scale", scale)}
        effects = tuple(
            Effect(name=name, parameters={key: Quantity(x, "1", 0.0, "hidden")})
            for name, (key, x) in values.items()
        )
        truth = dataclasses.replace(STOCK, effects=effects)
        record = fly(truth, paths[n], 12.0, shape=f"shape {n}", name=f"flight {n}", believed=STOCK)
        noisy = with_noise(record, 0.5, rng)
        assert record.voltage is not None
        voltage = record.voltage + 0.005 * rng.standard_normal(record.t.size)
        records.append(dataclasses.replace(noisy, voltage=voltage))
    training = training_set(records, Model(STOCK))
    none, found = refine(Model(STOCK), (), training), refine(Model(STOCK), (MASS,), training)
    return none, found, judge(none, found, (MASS,), training, np.random.default_rng(1))


def test_four_flights_that_all_weigh_more_tell_a_mass() -> None:
    _, found, judgement = fitted(0.055, [0.996, 1.003, 1.005, 0.997])
    assert judgement.significant
    assert not judgement.at_bound
    assert judgement.sizeable
    assert found.model.values[MASS] == pytest.approx(0.055, abs=0.005)
    assert found.estimate.fit.spread[len(NUISANCES)] < 0.01


def test_four_airframes_that_lift_differently_tell_none() -> None:
    scales = [0.96, 1.02, 1.05, 0.97]
    none, _, judgement = fitted(0.0, scales)
    assert not judgement.significant
    levels = none.estimate.fit.per_part[:, 0].reshape(-1, PARTS)
    assert levels.mean(axis=1) == pytest.approx(np.array(scales) - 1.0, abs=0.005)
    assert np.ptp(levels, axis=1).max() < 0.005
    assert none.estimate.fit.spread[0] < 0.005
    assert none.estimate.fit.spread[len(NUISANCES)] == pytest.approx(np.std(scales, ddof=1), rel=0.2)
