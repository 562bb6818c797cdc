"""The estimator follows poses, dead-reckons without them, and keeps the real filter's weaknesses."""

import math

import numpy as np
import pytest

from sim_backend.crazyflie.estimator import QUEUE_LENGTH, Estimator
from sim_backend.crazyflie.kalman import P_POSITION

DT = 0.001
LEVEL = (0.0, 0.0, 0.0, 1.0)
HOVER_ACC = np.array([0.0, 0.0, 9.81])
STILL = np.zeros(3)


def settle(
    estimator: Estimator,
    seconds: float,
    position: tuple[float, float, float] = (0.0, 0.0, 1.0),
    quaternion: tuple[float, float, float, float] = LEVEL,
    acc: np.ndarray = HOVER_ACC,
    gyro: np.ndarray = STILL,
    flying: bool = True,
) -> None:
    """Poses at 100 Hz of a drone at rest."""
    for tick in range(round(seconds / DT)):
        if tick % 10 == 0:
            estimator.external_pose(*position, *quaternion)
        estimator.step(acc, gyro, flying)


def test_first_pose_pulls_the_position_over_at_once() -> None:
    estimator = Estimator()
    settle(estimator, 0.05, (1.0, -2.0, 0.02))
    # the firmware's initial height variance (1 m2) and xy variance (100 m2) let the first pose win
    assert estimator.position() == pytest.approx((1.0, -2.0, 0.02), abs=1e-3)


def test_sine_motion_is_followed_with_ten_ms_of_latency() -> None:
    estimator = Estimator()
    rng = np.random.default_rng(1)
    amplitude, rate = 0.5, 2 * math.pi * 0.5
    worst = 0.0
    for tick in range(6000):
        t = tick * DT
        truth = amplitude * math.sin(rate * t)
        acc = np.array([-amplitude * rate**2 * math.sin(rate * t), 0.0, 9.81]) + rng.normal(0, 0.05, 3)
        if tick % 10 == 0:
            estimator.external_pose(amplitude * math.sin(rate * (t - 0.01)), 0.0, 1.0, *LEVEL)
        estimator.step(acc, STILL, False)
        if t > 3:
            worst = max(worst, abs(estimator.position()[0] - truth))
    # the latency alone is 10 ms * 1.57 m/s = 16 mm
    assert worst < 0.025


def test_dead_reckoning_drifts_and_says_so() -> None:
    estimator = Estimator()
    settle(estimator, 5.0)
    variance = float(estimator.state[P_POSITION])
    drift = []
    biased = HOVER_ACC + np.array([0.05, 0.0, 0.0])
    for _ in range(3):
        for _ in range(1000):
            estimator.step(biased, STILL, False)
        drift.append(estimator.position()[0])
    assert drift[0] > 0.015
    assert drift[1] > 3 * drift[0]
    assert drift[2] > drift[1]
    assert estimator.state[P_POSITION] > 10 * variance


@pytest.mark.parametrize("factor", [1.0, -1.0, 0.5])
def test_attitude_residual_ignores_sign_and_scale(factor: float) -> None:
    angle = 0.05
    measured = (0.0, factor * math.sin(angle / 2), 0.0, factor * math.cos(angle / 2))
    estimator = Estimator()
    settle(estimator, 2.0, quaternion=measured, acc=np.array([-math.sin(angle), 0, math.cos(angle)]) * 9.81)
    # 0.1 mrad of each residual's 0.07 is not made good: 1.4 mrad may stay
    assert estimator.roll_pitch_yaw()[1] == pytest.approx(angle, abs=1.6e-3)


def test_attitude_flip_in_the_mocap_throws_the_estimate() -> None:
    estimator = Estimator()
    settle(estimator, 2.0)
    half_turn_less_a_bit = (0.0, math.sin(1.5), 0.0, math.cos(1.5))
    estimator.external_pose(0.0, 0.0, 1.0, *half_turn_less_a_bit)
    for _ in range(2):
        estimator.step(HOVER_ACC, STILL, True)
    # 2 tan(1.5) = 28 rad of residual, nowhere near the 3 rad between the two attitudes
    assert abs(estimator.roll_pitch_yaw()[1]) > 0.5 or abs(estimator.quaternion()[3]) < 0.8


def test_gyro_alone_carries_the_attitude_between_poses() -> None:
    estimator = Estimator()
    settle(estimator, 1.0)
    for _ in range(100):
        estimator.step(HOVER_ACC, np.array([0.0, -10.0, 0.0]), True)
    for _ in range(20):  # until a prediction has seen the last of it
        estimator.step(HOVER_ACC, STILL, True)
    assert estimator.roll_pitch_yaw()[1] == pytest.approx(-1.0, abs=2e-3)


def test_full_queue_drops_and_counts() -> None:
    estimator = Estimator()
    for _ in range(QUEUE_LENGTH + 5):
        estimator.external_position(0.0, 0.0, 1.0)
    estimator.step(HOVER_ACC, STILL, True)
    assert estimator.rejected == 5
    assert estimator.corrections == QUEUE_LENGTH


def test_nan_pose_poisons_until_reset() -> None:
    estimator = Estimator()
    settle(estimator, 0.5)
    estimator.external_pose(math.nan, 0.0, 1.0, *LEVEL)
    settle(estimator, 0.5)
    assert math.isnan(estimator.position()[0])
    estimator.reset()
    settle(estimator, 0.5, (0.2, 0.0, 1.0))
    assert estimator.position()[0] == pytest.approx(0.2, abs=1e-3)


def test_state_out_of_bounds_resets() -> None:
    estimator = Estimator()
    settle(estimator, 0.5)
    fast = np.array([0.0, 0.0, 40.0])
    assert any(estimator.step(fast, STILL, True) for _ in range(1000))
    assert abs(estimator.velocity()[2]) < 10


def test_initial_yaw_is_a_parameter() -> None:
    estimator = Estimator()
    estimator.settings.initial = (1.0, 2.0, 0.0, 1.0)
    estimator.reset()
    assert estimator.position() == (1.0, 2.0, 0.0)
    assert estimator.roll_pitch_yaw()[2] == pytest.approx(1.0)
