"""A delay can be fitted to the end though the response to it is a broken line."""

import numpy as np

from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Training, training_set
from calibration.gap.replay.teacher_forcing import LONGEST_STEP
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise

STOCK = Model(load_vehicle("crazyflie21-stock"))
DELAY = Variable("command_delay", "delay")


def derivative(training: Training, delay: float) -> np.ndarray:
    model = STOCK.with_values({DELAY: delay})
    return model.derivative(training.records, DELAY, model.predict(training.records))


def test_to_both_sides_of_a_whole_step_of_a_prediction_a_delay_has_one_derivative() -> None:
    """Were it another, each side would ask for a step to the other one, and a fit would never arrive."""
    rng = np.random.default_rng(5)
    paths = (circle(period=2.0), up_and_down(period=2.0))
    records = [
        with_noise(fly(STOCK.base, path, 6.0, shape=f"shape {n}", name=f"flight {n}"), 0.5, rng)
        for n, path in enumerate(paths)
    ]
    training = training_set(records, STOCK)
    below, above = (derivative(training, 2.0 * LONGEST_STEP + beside) for beside in (-2e-5, 2e-5))
    assert np.linalg.norm(above - below) < 0.005 * np.linalg.norm(below)


def test_a_delay_of_nothing_has_a_derivative_towards_more() -> None:
    rng = np.random.default_rng(6)
    flight = with_noise(fly(STOCK.base, circle(period=2.0), 6.0, shape="circle", name="one"), 0.5, rng)
    training = training_set([flight], STOCK)
    there = STOCK.with_values({DELAY: LONGEST_STEP}).predict(training.records)
    here = STOCK.with_values({DELAY: 0.0}).predict(training.records)
    slope = (there - here)[:, :6] / LONGEST_STEP
    assert np.allclose(derivative(training, 0.0)[:, :6], slope)
