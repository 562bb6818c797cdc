"""The model that a drone flies in a rehearsal of its own: mechanics, and the simulated lab's physics."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from onboard.arrays import FloatArray
from onboard.flight_model import SIZE, THRUST, FlightModel, flight_model, fly_model, hovering
from onboard.gravity import GRAVITY
from onboard.mixer import Thrusts
from onboard.room import RoomGeometry
from onboard.rotation import body_z, to_matrix
from onboard.vehicle import load_vehicle
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.state import new_state
from sim_backend.physics.step import step_thrust

VEHICLE = load_vehicle("crazyflie21-upgraded")
MODEL = flight_model(VEHICLE)
INERTIA = np.array([MODEL.inertia_xx, MODEL.inertia_yy, MODEL.inertia_zz])
OFF: Thrusts = (0.0, 0.0, 0.0, 0.0)
DT = 1e-3


def four(thrusts: Iterable[float]) -> Thrusts:
    m1, m2, m3, m4 = (float(thrust) for thrust in thrusts)
    return m1, m2, m3, m4


def fly(
    state: FloatArray, thrusts: Thrusts, seconds: float, dt: float = DT, model: FlightModel = MODEL
) -> FloatArray:
    state = state.copy()
    for _ in range(round(seconds / dt)):
        fly_model(state, thrusts, model, dt)
    return state


def thrown(rate: Sequence[float] = (3.0, -20.0, 5.0), thrusts: Sequence[float] = OFF) -> FloatArray:
    """Tilted, on its way, turning."""
    state = hovering((0.3, -0.2, 5.0), MODEL)
    state[3:6] = 1.5, -0.4, 2.0
    state[6:10] = np.array([0.2, 0.3, -0.1, 0.9]) / np.linalg.norm([0.2, 0.3, -0.1, 0.9])
    state[10:13] = rate
    state[THRUST:] = thrusts
    return state


def test_it_hovers_where_it_was_started() -> None:
    start = hovering((1.0, 2.0, 3.0), MODEL)
    state = fly(start, four(start[THRUST:]), 2.0)
    np.testing.assert_allclose(state, start, atol=1e-12)
    assert start[THRUST:].sum() == pytest.approx(VEHICLE.body.mass.value * GRAVITY)


def test_without_thrust_it_falls_as_a_body_falls() -> None:
    start = thrown()
    state = fly(start, OFF, 0.8)
    fallen = start[:3] + 0.8 * start[3:6] - np.array([0.0, 0.0, 0.5 * GRAVITY * 0.8**2])
    np.testing.assert_allclose(state[:3], fallen, atol=1e-9)
    np.testing.assert_allclose(state[3:6], start[3:6] - np.array([0.0, 0.0, GRAVITY * 0.8]), atol=1e-9)


def test_without_thrust_it_keeps_energy_and_angular_momentum() -> None:
    """An explicit rule keeps them but for its error: that of the third order in a step, small at 1 kHz."""
    start = thrown()

    def energy(state: FloatArray) -> float:
        turning = 0.5 * float(np.sum(INERTIA * state[10:13] ** 2))
        return turning + MODEL.mass * (0.5 * float(np.sum(state[3:6] ** 2)) + GRAVITY * state[2])

    def momentum(state: FloatArray) -> FloatArray:
        world: FloatArray = to_matrix(state[6:10]) @ (INERTIA * state[10:13])
        return world

    size = float(np.linalg.norm(momentum(start)))
    lost = []
    for dt in (1e-3, 0.5e-3):
        state = fly(start, OFF, 0.5, dt)
        assert energy(state) == pytest.approx(energy(start), rel=1e-5)
        lost.append(float(np.linalg.norm(momentum(state) - momentum(start))) / size)
    assert lost[0] < 1e-3
    assert lost[1] < 0.3 * lost[0]


def test_a_flip_about_one_axis_has_the_angle_of_the_textbook() -> None:
    """A constant moment: half of it over the inertia times the time squared. Front motors: nose up."""
    each = 0.1
    start = hovering((0.0, 0.0, 1.0), MODEL)
    start[THRUST:] = each, 0.0, 0.0, each
    state = fly(start, (each, 0.0, 0.0, each), 0.06)
    acceleration = -2.0 * MODEL.arm_x * each / MODEL.inertia_yy
    assert state[11] == pytest.approx(acceleration * 0.06, rel=1e-9)
    b3 = body_z(state[6:10])
    assert np.arctan2(b3[0], b3[2]) == pytest.approx(0.5 * acceleration * 0.06**2, rel=1e-6)
    assert state[3] < 0.0


@pytest.mark.parametrize(
    ("motor", "signs"), [(0, (-1, -1, -1)), (1, (-1, 1, 1)), (2, (1, 1, -1)), (3, (1, -1, 1))]
)
def test_each_motor_turns_the_body_its_own_way(motor: int, signs: tuple[int, int, int]) -> None:
    thrusts = np.zeros(4)
    thrusts[motor] = 0.1
    state = hovering((0.0, 0.0, 0.0), MODEL)
    state[THRUST:] = thrusts
    assert tuple(np.sign(fly(state, four(thrusts), DT)[10:13]).astype(int)) == signs


def test_thrusts_follow_with_the_lag_of_each_direction_within_what_a_motor_can() -> None:
    state = hovering((0.0, 0.0, 0.0), MODEL)
    begun = state[THRUST]
    asked = (0.12, 0.0, 1.0, 0.5 * MODEL.thrust_min)
    up, down = (1.0 - np.exp(-0.03 / t) for t in (MODEL.time_constant_up, MODEL.time_constant_down))
    wanted = np.array([0.12, 0.0, MODEL.thrust_max, 0.0]) - begun
    found = fly(state, asked, 0.03)[THRUST:] - begun
    np.testing.assert_allclose(found, wanted * np.array([up, down, up, down]), rtol=1e-9)


def test_a_thrust_that_is_no_number_is_none() -> None:
    state = hovering((0.0, 0.0, 1.0), MODEL)
    nan = float("nan")
    np.testing.assert_array_equal(fly(state, (nan, nan, nan, nan), 0.1), fly(state, OFF, 0.1))


def test_halving_the_step_divides_the_error_by_four() -> None:
    start, asked = thrown(thrusts=(0.05, 0.09, 0.02, 0.0)), (0.12, 0.03, 0.1, 0.06)
    exact = fly(start, asked, 0.2, 1e-3 / 64)
    errors = [np.abs(fly(start, asked, 0.2, 2e-3 / k) - exact) for k in (1, 2, 4)]
    moving = np.s_[:THRUST]  # the motors have no error
    orders = [
        np.log2(np.linalg.norm(coarse[moving]) / np.linalg.norm(fine[moving]))
        for coarse, fine in pairwise(errors)
    ]
    assert np.all((np.array(orders) > 1.95) & (np.array(orders) < 2.05)), orders
    assert np.abs(errors[0][THRUST:]).max() < 1e-12


def in_the_physics(state: FloatArray, thrusts: Thrusts, seconds: float) -> FloatArray:
    """The same by the simulated lab's physics, in air that does not resist, far from floor and ceiling."""
    parameters: Any = physics_parameters(VEHICLE, RoomGeometry())
    parameters["ceiling_z"], parameters["drag"], parameters["has_legs"] = 1e6, 0.0, 0
    for name in ("command_on", "motors_on", "forces_on", "sensors_on"):
        parameters[name] = 0
    world: Any = new_state()
    world["position"], world["velocity"] = state[:3] + np.array([0.0, 0.0, 1000.0]), state[3:6]
    world["quaternion"], world["omega"], world["thrust"] = state[6:10], state[10:13], state[THRUST:]
    for _ in range(round(seconds / DT)):
        step_thrust(world, parameters, thrusts, DT)
    found = np.empty(SIZE)
    found[:3], found[3:6] = world["position"] - np.array([0.0, 0.0, 1000.0]), world["velocity"]
    found[6:10], found[10:13], found[THRUST:] = world["quaternion"], world["omega"], world["thrust"]
    return found


def test_it_flies_as_the_simulated_labs_physics_without_air() -> None:
    """Random states and thrusts, 0.3 s: one scheme, two programs."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        start = thrown(rate=rng.uniform(-15.0, 15.0, 3), thrusts=rng.uniform(0.0, 0.14, 4))
        asked = four(rng.uniform(MODEL.thrust_min, MODEL.thrust_max, 4))
        np.testing.assert_allclose(fly(start, asked, 0.3), in_the_physics(start, asked, 0.3), atol=1e-9)
