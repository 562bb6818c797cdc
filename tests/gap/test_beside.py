"""The nearest name is not given to what another explains better; what it explains beside that is its own."""

from functools import cache

import numpy as np
import pytest

from calibration.gap.estimate.acceptance import judge
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.search.beside import explained_better
from calibration.gap.search.candidates import Candidate
from onboard.vehicle import EFFECTS, load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
DAMPING = tuple(Variable("rate_damping", axis) for axis in "xyz")


@cache
def training() -> Training:
    """Four flights with much damping, and slow motors."""
    rng = np.random.default_rng(5)
    damping = {v: Model(STOCK).rule(v).high for v in DAMPING}
    truth = Model(STOCK, {**damping, Variable("motor_lag", "scale"): 1.6}).vehicle()
    paths = (circle(period=2.0), up_and_down(period=2.0), circle(period=3.0), up_and_down(period=3.0))
    records = [
        with_noise(fly(truth, path, 12.0, shape=f"shape {n}", name=f"{n}", believed=STOCK), 0.5, rng)
        for n, path in enumerate(paths)
    ]
    return training_set(records, Model(STOCK))


@cache
def none() -> Fitted:
    return refine(Model(STOCK), (), training())


@cache
def offered(effect: str) -> tuple[Candidate, Fitted, float]:
    """A candidate, its fit, and what it gains."""
    variables = tuple(Variable(effect, parameter) for parameter in EFFECTS[effect].parameters)
    fitted = refine(Model(STOCK), variables, training())
    gain = judge(none(), fitted, variables, training(), np.random.default_rng(1)).gain
    return Candidate(effect, variables, (none().model,)), fitted, gain


def better(effect: str, than: str) -> bool:
    candidate, fitted, gain = offered(effect)
    other = offered(than)[:2]
    return explained_better((candidate, fitted), gain, [other], none(), training())


@pytest.mark.further
def test_what_a_slow_motor_explains_better_is_named_nothing_else() -> None:
    assert offered("inertia_error")[2] > 500.0
    assert better("inertia_error", than="motor_lag")
    assert better("motor_lag_asymmetry", than="motor_lag")


def test_what_explains_less_and_something_else_is_not_kept_from_its_name() -> None:
    """A damping gains less than half of what the lag does, and as much beside it."""
    assert offered("rate_damping")[2] < 0.5 * offered("motor_lag")[2]
    assert not better("rate_damping", than="motor_lag")
