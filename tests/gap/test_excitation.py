"""What a controller's answers to noise look like, and what is a vehicle's own motion."""

import numpy as np

from calibration.gap.data.excitation import (
    answered,
    commanded,
    excitation_weights,
    excited,
    quiet_level,
)
from calibration.gap.data.signals import TORQUE, Signals
from onboard.arrays import FloatArray

DT, SECONDS = 0.01, 20.0
ROWS = round(SECONDS / DT)
NOISE = 2.0
"""rad/s2, of angular accelerations that no model explains, over 0.1 s."""


def flight(motion: FloatArray) -> tuple[Signals, FloatArray]:
    """A flight with this angular acceleration about all axes, shape (n,), and what a true model predicts."""
    predicted = np.zeros((ROWS, 7))
    predicted[:, TORQUE] = motion[:, None]
    gusts = np.repeat(np.random.default_rng(5).normal(0.0, NOISE, (ROWS // 10, 3)), 10, axis=0)
    measured = predicted.copy()
    measured[:, TORQUE] += gusts
    return Signals(measured, np.ones((ROWS, 7), bool), np.array([0, ROWS]), DT), predicted


def quiet_and_answered(signals: Signals, predicted: FloatArray) -> tuple[FloatArray, FloatArray]:
    quiet = quiet_level(commanded(signals, predicted))
    return quiet, answered(quiet, signals, predicted)


def test_a_vehicle_that_shakes_all_the_time_answers_nothing_by_it() -> None:
    signals, predicted = flight(40.0 * np.sin(2.0 * np.pi * 2.3 * DT * np.arange(ROWS)))
    quiet, answer = quiet_and_answered(signals, predicted)
    variance = commanded(signals, predicted)
    assert not excited(excitation_weights(variance, quiet))
    assert excited(excitation_weights(variance, answer))
    assert np.all(answer < 20.0 * NOISE**2)


def test_answers_as_large_as_what_they_answer_stay_answers() -> None:
    answers = np.repeat(np.random.default_rng(6).normal(0.0, 2.0 * NOISE, ROWS // 10), 10)
    quiet, answer = quiet_and_answered(*flight(answers))
    np.testing.assert_array_equal(answer, quiet)


def test_a_gap_in_the_log_hides_no_shaking() -> None:
    signals, predicted = flight(40.0 * np.sin(2.0 * np.pi * 2.3 * DT * np.arange(ROWS)))
    signals.measured[100:105], signals.valid[100:105] = np.nan, False
    quiet, answer = quiet_and_answered(signals, predicted)
    assert np.all(np.isfinite(answer))
    assert np.all(answer < 0.2 * quiet)
