"""What has no name makes a verdict only where it is large enough to matter to a flight."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from calibration.gap.data.channels import BY_NAME, attitudes
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.refine import Training, refine, training_set
from calibration.gap.unnamed.consequence import LEAST_ERROR, amplitude, least_amplitude
from calibration.gap.unnamed.fitted_terms import best_term, formulas, with_consequence
from calibration.gap.unnamed.regressors import regressors
from calibration.gap.unnamed.terms import interval_term
from onboard.controller import controller_gains
from onboard.vehicle import Vehicle, load_vehicle
from tests.gap.simulated_flight import circle, fly, with_noise
from tests.truth.tunnel import draw, nominal

STOCK = load_vehicle("crazyflie21-stock")
ROLL = BY_NAME["torque_x"]


@cache
def healthy() -> Training:
    """Laps of several sizes; nothing is hidden."""
    rng = np.random.default_rng(1)
    paths = [circle(radius, period) for radius, period in ((0.6, 4.0), (0.5, 3.0), (0.7, 5.0), (0.6, 3.5))]
    records = [
        with_noise(fly(STOCK, path, 8.0, shape=f"shape {n % 4}", name=f"flight {n}"), 0.3, rng)
        for n, path in enumerate(2 * paths)
    ]
    return training_set(records, Model(STOCK))


def with_torque(size: float) -> Training:
    """The same with a roll acceleration of `size` (rad/s2) where x > 0.2 m, which no effect describes."""
    training = healthy()
    regression = training.regression
    signals = regression.signals
    (x,) = (one for one in regressors(training.records) if one.name == "x")
    column = interval_term(ROLL, x, (0.2, None), attitudes(training.records)).columns[0]
    measured = np.where(signals.valid, signals.measured + size * column, 0.0)
    changed = type(regression)(dataclasses.replace(signals, measured=measured), regression.weights)
    return dataclasses.replace(training, regression=changed)


@pytest.mark.parametrize(("times", "matters"), [(0.5, False), (2.0, True)])
def test_a_torque_without_a_name_makes_a_verdict_only_where_it_matters(times: float, matters: bool) -> None:
    size = times * least_amplitude(ROLL, STOCK)
    training = with_torque(size)
    term = best_term(refine(Model(STOCK), (), training), training, np.random.default_rng(1))
    assert term is not None  # far beyond chance either way: it stays in the model, or a name would be given
    assert term.structure.channel is ROLL
    assert with_consequence((term,), term.after, training) == ((term,) if matters else ())
    (words,) = formulas(term.after, [term.term], STOCK)
    assert float(words.split()[0]) == pytest.approx(size * STOCK.body.inertia_xx.value, rel=0.1)


@pytest.mark.parametrize("vehicle", [STOCK, nominal(draw(3, 0.0))], ids=["30 g", "kilograms"])
def test_the_least_torque_tilts_the_flown_vehicle_as_the_least_force_pushes_it(vehicle: Vehicle) -> None:
    gains = controller_gains(vehicle)
    for name, inertia in (("torque_x", gains.inertia_xx), ("torque_y", gains.inertia_yy)):
        moment = inertia * least_amplitude(BY_NAME[name], vehicle)
        tilt = moment / gains.kr_xy
        assert 0.5 * 9.81 * tilt == pytest.approx(LEAST_ERROR, rel=1e-3)
    assert 0.5 * least_amplitude(BY_NAME["world_force_y"], vehicle) == pytest.approx(LEAST_ERROR)


def test_a_term_is_as_large_as_where_it_acts_however_seldom_that_is() -> None:
    training = healthy()
    (x,) = (one for one in regressors(training.records) if one.name == "x")
    turns, valid = attitudes(training.records), training.regression.signals.valid
    for low in (-1.0, 0.2, 0.5):
        for channel in (ROLL, BY_NAME["world_force_x"]):
            term = interval_term(channel, x, (low, None), turns)
            assert amplitude(term, np.array([-0.3]), valid) == pytest.approx(0.3, rel=0.02)
    nowhere = interval_term(ROLL, x, (50.0, None), turns)
    assert amplitude(nowhere, np.array([0.3]), valid) == 0.0
