"""The filter: its invariants, its consistency, and what it has of the firmware's own."""

import math

import numpy as np
import pytest

from onboard.arrays import FloatArray
from onboard.rotation import conjugate, euler_angles, from_yaw, integrate, multiply, rotate
from onboard.vehicle import load_vehicle
from sim_backend.crazyflie.estimator import Estimator
from sim_backend.crazyflie.kalman import BODY_VELOCITY, FIRST_PREDICTION_MS, P_VELOCITY
from sim_backend.crazyflie.sensors import InertialSensors
from tests.sim_crazyflie.simulated_flight import LEGS, VEHICLE

LEVEL = (0.0, 0.0, 0.0, 1.0)
HOVER: FloatArray = np.array([0.0, 0.0, 9.81])
PUSH: FloatArray = np.array([2.0, 0.0, 0.0])
STILL: FloatArray = np.zeros(3)


def run(
    estimator: Estimator, ms: int, acc: FloatArray, gyro: FloatArray = STILL, flying: bool = True
) -> None:
    for _ in range(ms):
        estimator.step(acc, gyro, flying)


def known_at(
    position: tuple[float, float, float], quaternion: tuple[float, float, float, float]
) -> Estimator:
    """A filter that has had poses of a drone at rest for 2 s."""
    estimator = Estimator()
    for tick in range(2000):
        if tick % 10 == 0:
            estimator.external_pose(*position, *quaternion)
        estimator.step(HOVER, STILL, True)
    return estimator


def tumble(estimator: Estimator, seed: int, yaw: float = 0.0) -> FloatArray:
    """4 s of turning and flipping with poses, some together, some missing; the states, as they went out.

    The whole world is turned by `yaw`.
    """
    rng = np.random.default_rng(seed)
    turn = from_yaw(yaw)
    estimator.settings.initial = (0.0, 0.0, 0.0, yaw)
    estimator.reset()
    attitude, position = LEVEL, np.zeros(3)
    states = []
    for tick in range(4000):
        flip = 15.0 if 2000 < tick < 2200 else 0.0
        gyro = np.array([2 * math.sin(0.003 * tick), flip + math.sin(0.004 * tick), math.sin(0.002 * tick)])
        attitude = integrate(attitude, gyro, 0.001)
        position += 0.001 * np.array([math.cos(0.001 * tick), math.sin(0.002 * tick), 0.5])
        noise, wobble = rng.normal(0.0, 0.002, 3), rng.normal(0.0, 0.01, 3)
        if tick % 10 == 7 and not 3000 < tick < 3300:
            seen = multiply(turn, integrate(attitude, wobble, 1.0))
            for _ in range(2 if tick % 70 == 7 else 1):
                estimator.external_pose(*rotate(turn, position + noise), *seen)
        estimator.step(HOVER + rng.normal(0.0, 0.3, 3), gyro + rng.normal(0.0, 0.05, 3), tick > 300)
        states.append(estimator.state.copy())
        covariance = estimator.covariance
        assert np.array_equal(covariance, covariance.T)
        if tick % 20 == 0:
            assert np.linalg.eigvalsh(covariance)[0] > 0.0
    return np.array(states)


def test_covariance_stays_symmetric_and_positive_and_a_turned_world_changes_nothing() -> None:
    yaw = 2.0
    plain, turned = tumble(Estimator(), 3), tumble(Estimator(), 3, yaw)
    turn = from_yaw(yaw)
    for one, other in zip(plain[::50], turned[::50], strict=True):
        assert other[:3] == pytest.approx(rotate(turn, one[:3]), abs=1e-9)
        assert other[3:6] == pytest.approx(rotate(turn, one[3:6]), abs=1e-9)
        assert other[6:10] == pytest.approx(multiply(turn, tuple(one[6:10])), abs=1e-9)
        assert other[P_VELOCITY : P_VELOCITY + 6] == pytest.approx(one[P_VELOCITY : P_VELOCITY + 6], rel=1e-6)


def test_the_error_is_as_large_as_the_covariance_says() -> None:
    """Normalised squared error of a drone whose noise is the filter's own: nine on average."""
    rng = np.random.default_rng(5)
    scores = []
    for _ in range(25):
        estimator = Estimator()
        attitude = integrate(LEVEL, rng.normal(0.0, 0.01, 3), 1.0)
        position, velocity = rng.normal(0.0, 1.0, 3), rng.normal(0.0, 0.01, 3)
        for tick in range(3000):
            push = np.array([*rng.normal(0.0, 0.5, 2), 9.81])  # x and y are not listened to in flight
            velocity += 0.001 * (np.array(rotate(attitude, push)) - HOVER)
            position += 0.001 * velocity
            if tick % 10 == FIRST_PREDICTION_MS:
                measured = integrate(attitude, rng.normal(0.0, 0.0045, 3), 1.0)
                estimator.external_pose(*(position + rng.normal(0.0, 0.01, 3)), *measured)
            estimator.step(push + np.array([0.0, 0.0, rng.normal(0.0, 1.0)]), rng.normal(0.0, 0.1, 3), True)
            if tick % 500 == FIRST_PREDICTION_MS + 1 and tick > 1000:  # as of the ms before
                q = estimator.quaternion()
                left = multiply(conjugate(q), attitude)
                error = np.array(
                    [
                        *(position - estimator.position()),
                        *(np.array(rotate(conjugate(q), velocity)) - estimator.state[BODY_VELOCITY:]),
                        *(2.0 * np.array(left[:3]) * np.sign(left[3])),
                    ]
                )
                scores.append(float(error @ np.linalg.solve(estimator.covariance, error)))
    assert np.mean(scores) == pytest.approx(9.0, abs=1.5)


def test_nothing_moves_between_predictions() -> None:
    estimator = known_at((0.0, 0.0, 1.0), LEVEL)
    run(estimator, 10, HOVER)
    heights = []
    for _ in range(30):
        run(estimator, 1, 1.1 * HOVER, np.array([0.0, 1.0, 0.0]))
        heights.append((estimator.position()[2], estimator.quaternion()))
    changes = [k for k in range(1, 30) if heights[k] != heights[k - 1]]
    assert changes == [FIRST_PREDICTION_MS + 1, FIRST_PREDICTION_MS + 11, FIRST_PREDICTION_MS + 21]


def test_drag_slows_a_drone_in_flight() -> None:
    estimator = known_at((0.0, 0.0, 1.0), LEVEL)
    run(estimator, 500, HOVER + PUSH, flying=False)
    run(estimator, 10, HOVER)
    before = estimator.state[BODY_VELOCITY]
    estimator.drag[:] = 4.0, 0.0, 0.0, 0.0, 0.0, 0.0
    run(estimator, 500, HOVER)
    assert before == pytest.approx(1.0, abs=0.05)
    assert estimator.state[BODY_VELOCITY] == pytest.approx(before * (1.0 - 4.0 * 0.01) ** 50, rel=1e-6)
    estimator.drag[:] = 4.0, 0.0, 0.0, 0.0, 0.0, 0.03
    run(estimator, 3000, HOVER, np.array([0.0, 0.0, 0.0]))
    run(estimator, 10, HOVER, np.array([0.0, 0.1, 0.0]))
    run(estimator, 10, HOVER)
    # a centre of pressure 3 cm up moves forward when the nose goes down, and drag holds it back
    gravity_alone = -9.81 * -math.sin(euler_angles(estimator.quaternion())[1]) * 0.01
    assert estimator.state[BODY_VELOCITY] < gravity_alone


@pytest.mark.parametrize(("flying", "speed"), [(True, 0.0), (False, 1.0)])
def test_only_a_drone_that_does_not_fly_believes_a_push_to_the_side(flying: bool, speed: float) -> None:
    estimator = known_at((0.0, 0.0, 1.0), LEVEL)
    run(estimator, 500, HOVER + PUSH, flying=flying)
    assert estimator.velocity()[0] == pytest.approx(speed, abs=0.03)


def test_a_drone_that_does_not_fly_is_pulled_upright() -> None:
    tilt = 0.2
    tilted = (0.0, math.sin(0.5 * tilt), 0.0, math.cos(0.5 * tilt))
    for flying, left in ((True, 1.0), (False, 0.999**100)):
        estimator = known_at((0.0, 0.0, 1.0), tilted)
        before = estimator.roll_pitch_yaw()[1]
        run(estimator, 1000, HOVER, flying=flying)
        assert estimator.roll_pitch_yaw()[1] == pytest.approx(before * left, rel=1e-3)


def test_without_poses_a_velocity_becomes_as_uncertain_as_the_noise_says() -> None:
    estimator = known_at((0.0, 0.0, 1.0), LEVEL)
    before = estimator.state[P_VELOCITY + 2]
    run(estimator, 2000, HOVER)
    assert estimator.state[P_VELOCITY + 2] - before == pytest.approx(2000 * (1.0 * 0.001) ** 2, rel=0.01)
    # along x there is the tilt that nobody knows, too
    assert estimator.state[P_VELOCITY] > before + 2000 * (0.5 * 0.001) ** 2


def test_a_lost_position_takes_the_attitude_s_corrections_with_it() -> None:
    estimator = known_at((0.0, 0.0, 1.0), LEVEL)
    estimator.external_pose(math.nan, 0.0, 1.0, *LEVEL)
    turned = (0.0, math.sin(0.1), 0.0, math.cos(0.1))
    for tick in range(500):
        if tick % 10 == 0:
            estimator.external_pose(0.0, 0.0, 1.0, *turned)
        estimator.step(HOVER, STILL, True)
    assert np.isnan(estimator.state[:6]).all()
    assert estimator.quaternion() == pytest.approx(LEVEL, abs=2e-3)


CLIMB = (0.8, 1.8, 2.6, 3.1, 3.3, 3.5, 3.6, 3.6, 3.6, 3.4, 3.1, 2.9, 2.8, 2.7, 1.9, 1.0, 0.0, 0.0)
"""m/s2 upwards, 50 ms each: how the simulated drone gets to 2.2 m/s in an approach of 2.5 m/s and 60 deg."""


@pytest.mark.parametrize(
    ("after_ms", "velocity", "height"), [(7, (8, 13), (-21, -16)), (0, (-10, -5), (-38, -33))]
)
def test_what_a_climb_leaves_depends_on_when_poses_come(
    after_ms: int, velocity: tuple[int, int], height: tuple[int, int]
) -> None:
    """Poses that are 10 ms late, `after_ms` after a prediction; mm/s and mm, when the policy next asks.

    The velocity is too large because the accelerometer's low-pass (30 Hz) has not yet seen that the climb is
    over, and because late poses find a prediction that has stood still.
    """
    estimator = Estimator()
    sensors = InertialSensors(load_vehicle(VEHICLE, LEGS).sensing, np.random.default_rng(0))
    sensors.settle(HOVER)
    z, v, past = 0.0, 0.0, []
    climb = np.repeat(CLIMB, 50)
    for tick, push in enumerate(np.concatenate([np.zeros(2000), climb])):
        past.append(z)
        if (tick - FIRST_PREDICTION_MS) % 10 == after_ms and tick > 10:
            estimator.external_pose(0.0, 0.0, past[tick - 10], *LEVEL)
        sensors.sample(HOVER + np.array([0.0, 0.0, push]), STILL)
        estimator.step(sensors.acc, STILL, True)
        if (tick + 1) % 10 == 0:
            v_error, z_error = 1e3 * (estimator.velocity()[2] - v), 1e3 * (estimator.position()[2] - z)
        z, v = z + 0.001 * v, v + 0.001 * push
    assert velocity[0] <= v_error <= velocity[1]
    assert height[0] <= z_error <= height[1]
