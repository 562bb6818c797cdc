"""A body that is harder to turn than its file says has its inertia named, and its thrust left alone."""

from functools import cache

import numpy as np
import pytest

from calibration.gap.estimate.acceptance import Judgement, judge
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.estimate.shared_nuisances import every_mean
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
INERTIA = tuple(Variable("inertia_error", axis) for axis in ("xx", "yy", "zz"))
SCALE, CURVE = Variable("thrust_scale", "scale"), Variable("thrust_curve", "curvature")
TRUE_SCALE = 0.95


@cache
def training() -> Training:
    """Four flights: 60 % more inertia, 5 % less thrust."""
    rng = np.random.default_rng(5)
    truth = Model(STOCK, {**dict.fromkeys(INERTIA, 0.6), SCALE: TRUE_SCALE}).vehicle()
    paths = (circle(period=2.0), up_and_down(period=2.0), circle(period=3.0), up_and_down(period=3.0))
    records = [
        with_noise(fly(truth, path, 12.0, shape=f"shape {n}", name=f"{n}", believed=STOCK), 0.5, rng)
        for n, path in enumerate(paths)
    ]
    return training_set(records, Model(STOCK))


def offered(*variables: Variable) -> tuple[Fitted, Judgement]:
    none = refine(Model(STOCK), (), training())
    fitted = refine(Model(STOCK), variables, training())
    return fitted, judge(none, fitted, variables, training(), np.random.default_rng(1))


@pytest.mark.parametrize("others", [(), (CURVE,), INERTIA], ids=["alone", "with a curve", "with inertias"])
def test_forces_say_what_the_thrust_is(others: tuple[Variable, ...]) -> None:
    """Torques ask for a third less of it, which each flight would have to undo for its forces."""
    fitted, _ = offered(SCALE, *others)
    assert fitted.model.values[SCALE] == pytest.approx(TRUE_SCALE, abs=0.005)
    nuisances = {one.name: one.mean for one in every_mean(fitted, STOCK)}
    assert abs(nuisances["thrust_scale"]) < 0.005


def test_no_curve_of_thrust_is_believed() -> None:
    scale = refine(Model(STOCK), (SCALE,), training())
    both = refine(Model(STOCK), (SCALE, CURVE), training())
    assert not judge(scale, both, (CURVE,), training(), np.random.default_rng(1)).significant


def test_the_inertia_is_believed() -> None:
    fitted, judgement = offered(SCALE, *INERTIA)
    assert judgement.significant
    assert not judgement.at_bound
    assert [fitted.model.values[v] for v in INERTIA] == pytest.approx([0.6, 0.6, 0.6], abs=0.05)
