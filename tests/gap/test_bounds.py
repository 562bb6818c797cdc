"""A value that flights ask for beyond its bounds stands in for something else."""

import dataclasses

import numpy as np
import pytest

from calibration.gap.estimate.acceptance import judge, stuck
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training, refine, training_set
from calibration.gap.search.bounds import without_axes_at_bounds
from calibration.gap.search.forward import search
from calibration.gap.search.selection import SearchContext
from onboard.quantity import Quantity
from onboard.vehicle import Effect, load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = load_vehicle("crazyflie21-stock")
DAMPING = tuple(Variable("rate_damping", axis) for axis in "xyz")
HIGH = Model(STOCK).rule(DAMPING[0]).high
TRUTH = {"x": 0.5 * HIGH, "y": 0.7 * HIGH, "z": 10.0 * HIGH}
"""N m s."""


def test_a_fit_that_ended_short_of_a_bound_that_it_was_going_to_is_at_the_bound() -> None:
    rng = np.random.default_rng(5)
    high = Model(STOCK).rule(DAMPING[0]).high
    damped = Effect(
        name="rate_damping",
        parameters={axis: Quantity(3.0 * high, "N*m*s", 0.0, "hidden") for axis in "xyz"},
    )
    truth = dataclasses.replace(STOCK, effects=(damped,))
    paths = (circle(period=2.0), up_and_down(period=2.0), circle(period=3.0), up_and_down(period=3.0))
    records = [
        with_noise(fly(truth, path, 12.0, shape=f"shape {n}", name=f"flight {n}", believed=STOCK), 0.5, rng)
        for n, path in enumerate(paths)
    ]
    training = training_set(records, Model(STOCK))
    none, found = refine(Model(STOCK), (), training), refine(Model(STOCK), DAMPING, training)
    short = [v for v in DAMPING if v in found.variables and not stuck(found.model, v)]
    judgement = judge(none, found, DAMPING, training, np.random.default_rng(1))
    assert short
    assert set(short) <= set(judgement.at_bound)


def yaw_beyond_all_bounds() -> Training:
    """Flights whose yaw is damped by whatever it may be, roll and pitch as much as may be."""
    rng = np.random.default_rng(5)
    damped = Effect(
        name="rate_damping",
        parameters={axis: Quantity(value, "N*m*s", 0.0, "hidden") for axis, value in TRUTH.items()},
    )
    vehicle = dataclasses.replace(STOCK, effects=(damped,))
    paths = (circle(period=2.0), up_and_down(period=2.0), circle(period=3.0), up_and_down(period=3.0))
    records = [
        with_noise(fly(vehicle, path, 6.0, shape=f"shape {n}", name=f"{n}", believed=STOCK), 0.3, rng)
        for n, path in enumerate(paths)
    ]
    return training_set(records, Model(STOCK))


def is_true_but_for_yaw(fitted: Fitted) -> bool:
    found = [fitted.model.start_value(v) for v in DAMPING]
    return found == pytest.approx([TRUTH["x"], TRUTH["y"], 0.0], rel=0.1)


@pytest.mark.further  # without a search: the next one
def test_an_axis_that_nothing_known_explains_keeps_no_other_from_its_value() -> None:
    found = search(Model(STOCK), SearchContext(yaw_beyond_all_bounds(), np.random.default_rng(1)))
    assert found.refused["rate_damping z"].startswith("z ran into its bound")
    assert is_true_but_for_yaw(found.final)


def test_an_axis_that_ends_at_its_bound_when_all_is_found_is_as_the_file_says() -> None:
    training, refused = yaw_beyond_all_bounds(), dict[str, str]()
    fitted = refine(Model(STOCK), DAMPING, training)
    assert fitted.model.values[DAMPING[2]] > 0.9 * HIGH
    assert is_true_but_for_yaw(without_axes_at_bounds(fitted, training, refused))
    assert list(refused) == ["rate_damping z"]
