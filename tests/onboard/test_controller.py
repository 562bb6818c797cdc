"""Geometric controller: signs, convergence in an independent simulation, tracking of an approach."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from onboard.controller import (
    AUTHORS_GAINS,
    DEFAULT_GAINS,
    GRAVITY,
    ControllerGains,
    attitude_control,
    controller_gains,
    geometric_control,
    integrate_position_error,
    lead_moments,
)
from onboard.mixer import mix
from onboard.trajectory import plan_approach, sample_approach
from onboard.vehicle import load_vehicle

Array = NDArray[np.float64]
ZERO = (0.0, 0.0, 0.0)
LEVEL = (0.0, 0.0, 0.0, 1.0)
WEIGHT = DEFAULT_GAINS.mass * GRAVITY
SHORT = 1e-6
"""s: a step that is short for every lead."""
PLACES = np.array([[0.0325, -0.0325], [-0.0325, -0.0325], [-0.0325, 0.0325], [0.0325, 0.0325]])


def control(
    position: tuple[float, float, float] = ZERO,
    velocity: tuple[float, float, float] = ZERO,
    attitude: Rotation | None = None,
    omega: tuple[float, float, float] = ZERO,
    yaw: float = 0.0,
    acceleration: tuple[float, float, float] = ZERO,
) -> tuple[float, float, float, float]:
    q = LEVEL if attitude is None else tuple(attitude.as_quat())
    return geometric_control(position, velocity, q, omega, ZERO, ZERO, ZERO, acceleration, yaw, DEFAULT_GAINS)


def test_hover_needs_the_weight_and_no_moment() -> None:
    assert control() == pytest.approx((WEIGHT, 0.0, 0.0, 0.0), abs=1e-12)
    turned = Rotation.from_euler("z", 1.2)
    assert control(attitude=turned, yaw=1.2) == pytest.approx((WEIGHT, 0.0, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_moments_turn_the_body_back(axis: int, sign: float) -> None:
    vector = np.zeros(3)
    vector[axis] = 0.2 * sign
    moments = control(attitude=Rotation.from_rotvec(vector))[1:]
    assert moments[axis] * sign < 0.0
    rates = tuple(5.0 * vector)
    damping = control(omega=rates)[1:]  # type: ignore[arg-type]  # a tuple of three by construction
    assert damping[axis] * sign < 0.0
    others = [damping[i] for i in range(3) if i != axis]
    assert others == pytest.approx([0.0, 0.0], abs=1e-12)


def test_position_errors_tilt_and_lift_towards_the_target() -> None:
    assert control(position=(0.5, 0.0, 0.0))[2] < 0.0  # too far forward: nose up
    assert control(velocity=(0.5, 0.0, 0.0))[2] < 0.0
    assert control(position=(0.0, 0.5, 0.0))[1] > 0.0  # too far left: left side up
    assert control(position=(0.0, 0.0, 0.1))[0] < WEIGHT
    assert control(velocity=(0.0, 0.0, -0.5))[0] > WEIGHT
    assert control(acceleration=(0.0, 0.0, 2.0))[0] == pytest.approx(DEFAULT_GAINS.mass * (GRAVITY + 2.0))
    assert control(acceleration=(1.0, 0.0, 0.0))[2] > 0.0


def test_collective_stays_in_its_bounds_and_the_wish_never_points_down() -> None:
    down = control(position=(0.0, 0.0, 5.0))
    assert down[0] == 0.0
    assert down[1:] == pytest.approx(ZERO, abs=1e-12)
    assert control(position=(0.0, 0.0, -5.0))[0] == DEFAULT_GAINS.collective_max
    # Far to the side the wanted tilt is the limit of 50 deg, not more: its error equals that of 50 deg.
    at_limit = control(position=(-100.0, 0.0, 0.0), attitude=Rotation.from_euler("y", 50.0, degrees=True))
    assert at_limit[2] == pytest.approx(0.0, abs=1e-9)


def test_attitude_control_levels_whatever_the_position() -> None:
    tilted = Rotation.from_euler("y", 0.3)
    collective, tx, ty, tz = attitude_control(tuple(tilted.as_quat()), ZERO, 0.1, 0.0, DEFAULT_GAINS)
    assert collective == 0.1
    assert ty < 0.0
    assert (tx, tz) == pytest.approx((0.0, 0.0), abs=1e-12)


def simulate(
    gains: ControllerGains,
    target: Callable[[float], tuple[Array, Array, Array]],
    start: Array,
    duration: float,
    lag: tuple[float, float] = (0.05, 0.15),
    samples: int = 200,
) -> tuple[Array, Array]:
    """Newton-Euler with rotation matrices, first-order motors and forces at the motors' places.

    The lead is taken as the continuous one that its difference equations are in the limit of short steps.
    """
    inertia = np.array([gains.inertia_xx, gains.inertia_yy, gains.inertia_zz])

    def derivative(t: float, s: Array) -> Array:
        p, v, matrix, omega, thrusts, lagged = (
            s[:3], s[3:6], s[6:15].reshape(3, 3), s[15:18], s[18:22], s[22:25],
        )  # fmt: skip
        q = Rotation.from_matrix(matrix).as_quat()
        goal = target(t)
        law = geometric_control(p, v, q, omega, ZERO, goal[0], goal[1], goal[2], 0.0, gains)
        wrench, after = lead_moments(law, lagged, gains, SHORT)
        wanted = np.array(mix(*wrench, 0.0325, 0.0325, 0.00618, 0.147))
        speed = np.where(wanted > thrusts, 1.0 / lag[0], 1.0 / lag[1])
        torque = np.array(
            [
                PLACES[:, 1] @ thrusts,
                -PLACES[:, 0] @ thrusts,
                0.00618 * (thrusts @ np.array([-1.0, 1.0, -1.0, 1.0])),
            ]
        )
        hat = np.cross(np.eye(3), omega)
        return np.concatenate(
            [
                v,
                matrix[:, 2] * thrusts.sum() / gains.mass - np.array([0.0, 0.0, GRAVITY]),
                (matrix @ hat).ravel(),
                (torque - np.cross(omega, inertia * omega)) / inertia,
                (wanted - thrusts) * speed,
                (after - lagged) / SHORT if gains.lead_pole > 0.0 else np.zeros(3),
            ]
        )

    times = np.linspace(0.0, duration, samples)
    result = solve_ivp(derivative, (0.0, duration), start, t_eval=times, max_step=0.01, rtol=1e-4, atol=1e-6)
    return times, result.y.T


def state(
    position: tuple[float, float, float] = ZERO,
    attitude: Rotation | None = None,
    omega: tuple[float, float, float] = ZERO,
) -> Array:
    matrix = np.eye(3) if attitude is None else attitude.as_matrix()
    hover = np.full(4, WEIGHT / 4)
    return np.concatenate([position, ZERO, matrix.ravel(), omega, hover, ZERO])


def hover(_: float) -> tuple[Array, Array, Array]:
    return np.zeros(3), np.zeros(3), np.zeros(3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "start",
    [
        pytest.param(state(position=(0.5, -0.4, 0.3)), marks=pytest.mark.further),
        state(attitude=Rotation.from_euler("ZYX", [60, -45, 40], degrees=True)),
        pytest.param(state(position=(-0.3, 0.2, -0.4), omega=(4.0, -4.0, 2.0)), marks=pytest.mark.further),
        state(attitude=Rotation.from_euler("x", 110, degrees=True), position=(0.0, 0.0, 1.0)),
    ],
)
def test_converges_from_disturbed_states(start: Array) -> None:
    _, states = simulate(DEFAULT_GAINS, hover, start, 6.0)
    end = states[-1]
    assert np.linalg.norm(end[:3]) < 0.03
    assert np.linalg.norm(end[3:6]) < 0.03
    assert end[6:15].reshape(3, 3)[2, 2] > math.cos(math.radians(2.0))
    assert np.linalg.norm(end[15:18]) < 0.1


@pytest.mark.parametrize(
    "lag",
    [(0.05, 0.05), pytest.param((0.05, 0.15), marks=pytest.mark.soak), (0.08, 0.2)],
)
def test_stable_over_the_motor_lags_that_were_measured(lag: tuple[float, float]) -> None:
    _, states = simulate(DEFAULT_GAINS, hover, state(position=(0.2, 0.2, 0.2)), 5.0, lag)
    late = states[-40:]
    assert np.abs(late[:, :3]).max() < 0.03
    assert np.abs(late[:, 15:17]).max() < 0.5


@pytest.mark.parametrize(("speed", "angle_deg"), list(itertools.product([1.5, 2.5], [35.0, 60.0])))
def test_tracks_an_approach_to_the_trigger(speed: float, angle_deg: float) -> None:
    plan = plan_approach(speed, angle_deg, 0.0, 2.1, 1.0, 3.1, 0.5)

    def target(t: float) -> tuple[Array, Array, Array]:
        p, v, a = sample_approach(plan, t)
        return np.array(p), np.array(v), np.array(a)

    until_trigger = plan.impact_time - 0.23
    _, states = simulate(DEFAULT_GAINS, target, state(position=(plan.x0, 0.0, plan.z0)), until_trigger)
    end = states[-1]
    # The authors' flights: v_x -0.17 +- 0.27, v_z +0.07 +- 0.09 m/s, pitch up to 16 deg.
    assert end[3] == pytest.approx(plan.vx, abs=0.12)
    assert end[5] == pytest.approx(plan.vz, abs=0.12)
    assert end[14] > math.cos(math.radians(8.0))


def test_gains_scale_so_that_another_vehicle_flies_the_same() -> None:
    upgraded = controller_gains(load_vehicle("crazyflie21-upgraded-stored"))
    assert upgraded.mass == pytest.approx(DEFAULT_GAINS.mass)
    assert upgraded.kr_xy == pytest.approx(DEFAULT_GAINS.kr_xy)
    assert upgraded.collective_max == pytest.approx(0.9 * 4 * 0.015 * 9.80665)
    stock = controller_gains(load_vehicle("crazyflie21-stock"))
    assert stock.kp_z / stock.mass == pytest.approx(upgraded.kp_z / upgraded.mass)
    assert stock.kr_xy < 0.6 * upgraded.kr_xy


def test_authors_gains_are_the_documented_alternative() -> None:
    assert (AUTHORS_GAINS.kr_xy, AUTHORS_GAINS.kw_xy, AUTHORS_GAINS.kp_z) == (0.004, 0.0017, 1.2)
    _, states = simulate(AUTHORS_GAINS, hover, state(position=(0.1, 0.0, 0.1)), 6.0)
    assert np.linalg.norm(states[-1][:3]) < 0.05


def test_equal_time_constants_are_no_lead() -> None:
    wrench = (0.3, 1e-3, -2e-3, 3e-4)
    for constant in (0.0, 0.05):
        gains = DEFAULT_GAINS._replace(lead_zero=constant, lead_pole=constant)
        assert lead_moments(wrench, (4e-3, 0.0, -1e-3), gains, 0.002)[0] == wrench


def test_lead_answers_a_step_first_with_more_and_then_with_the_moment_itself() -> None:
    gains, dt = DEFAULT_GAINS, 0.002
    lagged, answers = ZERO, []
    for _ in range(200):
        wrench, lagged = lead_moments((0.3, 1e-3, -1e-3, 5e-4), lagged, gains, dt)
        answers.append(wrench)
    first = (gains.lead_zero + dt) / (gains.lead_pole + dt)
    assert answers[0] == pytest.approx((0.3, first * 1e-3, -first * 1e-3, first * 5e-4))
    # Backward Euler keeps a share of pole / (pole + dt) of the difference a step.
    share = gains.lead_pole / (gains.lead_pole + dt)
    assert (answers[10][1] - 1e-3) / (answers[0][1] - 1e-3) == pytest.approx(share**10)
    assert answers[-1] == pytest.approx((0.3, 1e-3, -1e-3, 5e-4))
    assert lagged == pytest.approx((1e-3, -1e-3, 5e-4))


def test_lead_gets_over_a_moment_that_is_not_a_number() -> None:
    lagged = (1e-3, 2e-3, 3e-3)
    wrench, after = lead_moments((0.3, math.nan, math.inf, 3e-3), lagged, DEFAULT_GAINS, 0.002)
    assert after == pytest.approx(lagged)
    assert math.isnan(wrench[1])
    assert wrench[2] == math.inf
    assert wrench[3] == pytest.approx(3e-3)


def test_position_integral_is_bounded_and_deaf_to_nan() -> None:
    integral = ZERO
    for _ in range(1000):
        integral = integrate_position_error(integral, (1.0, -1.0, 0.001), ZERO, 0.01, 0.3)
    assert integral == pytest.approx((0.3, -0.3, 0.01))
    assert integrate_position_error(integral, (math.nan, 0.0, 0.0), ZERO, 0.01, 0.3) == integral
    pulled = geometric_control(ZERO, ZERO, LEVEL, ZERO, (0.0, 0.0, 0.3), ZERO, ZERO, ZERO, 0.0, DEFAULT_GAINS)
    assert pulled[0] == pytest.approx(WEIGHT - 0.03)
