"""Motors, battery, hover and symmetry in free flight."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from onboard.battery import duty_for_thrust
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import approaching
from sim_backend.physics.state import new_state
from sim_backend.physics.step import step, step_thrust

STILL = np.zeros(3)


def test_thrust_follows_the_exponential_of_each_direction(open_sky: Any, high: NDArray[np.float64]) -> None:
    state = approaching(open_sky, high, STILL)
    state["thrust"] = [0.0, 0.1, 0.1, 0.0]
    for _ in range(30):
        step_thrust(state, open_sky, (0.12, 0.0, 0.0, 0.12), 1e-3)
    up, down = 0.12 * (1.0 - np.exp(-0.03 / 0.05)), 0.1 * np.exp(-0.03 / 0.15)
    np.testing.assert_allclose(state["thrust"], [up, down, down, up], rtol=1e-12)


def test_hover_thrust_balances_the_weight(open_sky: Any, high: NDArray[np.float64]) -> None:
    state = approaching(open_sky, high, STILL)
    hover = float(open_sky["mass"] * open_sky["gravity"] / 4.0)
    for _ in range(1000):
        step_thrust(state, open_sky, (hover, hover, hover, hover), 1e-3)
    np.testing.assert_allclose(state["position"], high, atol=1e-9)
    np.testing.assert_allclose(state["specific_force"], [0.0, 0.0, 9.81], atol=1e-12)


@pytest.mark.parametrize(
    ("motor", "signs"),
    [(0, (-1, -1, -1)), (1, (-1, 1, 1)), (2, (1, 1, -1)), (3, (1, -1, 1))],
)
def test_each_motor_turns_the_body_its_own_way(
    open_sky: Any, high: NDArray[np.float64], motor: int, signs: tuple[int, int, int]
) -> None:
    """M1 front right, M2 back right, M3 back left, M4 front left; M1 and M3 yaw clockwise from above."""
    state = approaching(open_sky, high, STILL)
    targets = [0.0, 0.0, 0.0, 0.0]
    targets[motor] = 0.1
    state["thrust"] = targets
    step_thrust(state, open_sky, tuple(targets), 1e-3)
    assert tuple(np.sign(state["omega"]).astype(int)) == signs


def test_front_motors_pitch_the_nose_up(open_sky: Any, high: NDArray[np.float64]) -> None:
    """Nose up is a negative turn about b_y, and tips the thrust backwards."""
    state = approaching(open_sky, high, STILL)
    for _ in range(50):
        step_thrust(state, open_sky, (0.1, 0.0, 0.0, 0.1), 1e-3)
    assert state["omega"][1] < -1.0
    assert state["velocity"][0] < 0.0


def _fly_crooked(parameters: Any, mirror: bool, rng: np.random.Generator) -> Any:
    """A random flip with roll, yaw and drift into the ceiling, or its mirror image."""
    side = -1.0 if mirror else 1.0
    speed, climb, drift = rng.uniform(1.0, 2.5), rng.uniform(1.5, 2.5), side * rng.uniform(-0.4, 0.4)
    state = approaching(parameters, np.array([0.0, 0.0, 2.1 - 0.22 * climb]), np.array([speed, drift, climb]))
    state["omega"] = [side * rng.uniform(-1.0, 1.0), 0.0, side * rng.uniform(-1.0, 1.0)]
    front = rng.uniform(0.05, 0.14) * (1.0 + rng.uniform(-0.01, 0.01, 2))
    right, left = front[::-1] if mirror else front
    for k in range(400):
        step_thrust(state, parameters, (right, 0.0, 0.0, left) if k < 190 else (0.0,) * 4, 1e-3)
    return state


def test_left_and_right_are_mirror_images(parameters: Any) -> None:
    """Twenty landings and crashes, and their mirror images: equal to rounding, contact included."""
    feet = hulls = 0
    for seed in range(20):
        a = _fly_crooked(parameters, False, np.random.default_rng(seed))
        b = _fly_crooked(parameters, True, np.random.default_rng(seed))
        np.testing.assert_allclose(a["position"], b["position"] * [1, -1, 1], atol=1e-11)
        np.testing.assert_allclose(a["velocity"], b["velocity"] * [1, -1, 1], atol=1e-9)
        np.testing.assert_allclose(a["omega"], b["omega"] * [-1, 1, -1], atol=1e-8)
        np.testing.assert_array_equal(a["foot_attached"], b["foot_attached"][[3, 2, 1, 0]])
        assert a["body_contact"] == b["body_contact"]
        feet, hulls = feet + int(a["foot_attached"].sum() > 0), hulls + int(a["body_contact"])
    assert feet >= 10
    assert 3 <= hulls < 20


def test_battery_sags_under_load_and_empties(parameters: Any) -> None:
    parameters["ceiling_z"] = 1e6
    state = approaching(parameters, np.array([0.0, 0.0, 1e5]), STILL)
    rest = float(state["battery_voltage"])
    full = np.ones(4)
    for _ in range(300):
        step(state, parameters, full, 1e-3)
    current = float(parameters["current_per_newton"] * state["thrust"].sum())
    assert state["battery_current"] == pytest.approx(current)
    assert state["battery_voltage"] == pytest.approx(
        rest - parameters["battery_resistance"] * current, abs=2e-3
    )
    assert state["charge_used"] == pytest.approx(0.3 * current, rel=0.15)


def test_hover_duty_at_the_sagged_voltage_holds_the_weight(parameters: Any) -> None:
    """The duty from the onboard compensation at the present voltage gives the thrust that was asked for."""
    parameters["ceiling_z"] = 1e6
    vehicle = load_vehicle("crazyflie21-upgraded-stored")
    thrust_map = vehicle.motors.thrust_map_compiled()
    state = approaching(parameters, np.array([0.0, 0.0, 1e5]), STILL)
    hover = float(parameters["mass"] * parameters["gravity"] / 4.0)
    for _ in range(2000):
        duty = duty_for_thrust(hover, float(state["battery_voltage"]), thrust_map)
        step(state, parameters, np.full(4, duty), 1e-3)
    np.testing.assert_allclose(state["thrust"], hover, rtol=1e-6)
    assert abs(float(state["velocity"][2])) < 1e-4


def test_record_and_batch_give_the_same_numbers(open_sky: Any, high: NDArray[np.float64]) -> None:
    """One record and an element of an array of records run through the same kernel."""
    single = approaching(open_sky, high, np.array([1.0, 0.0, 1.0]))
    batch = np.repeat(np.array(single).reshape(1), 3)
    for _ in range(20):
        step_thrust(single, open_sky, (0.1, 0.05, 0.05, 0.1), 1e-3)
        for k in range(3):
            step_thrust(batch[k], open_sky, (0.1, 0.05, 0.05, 0.1), 1e-3)
    assert batch[2] == np.array(single)[()]


def test_bare_vehicle_has_no_legs() -> None:
    vehicle = load_vehicle("crazyflie21-stock")
    p = physics_parameters(vehicle, RoomGeometry())
    assert bool(p["has_legs"]) == (vehicle.legs is not None)
    assert new_state()["foot_attached"].sum() == 0
