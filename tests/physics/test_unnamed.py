"""What a vehicle file knows without a name, as the physics flies it."""

from typing import Any

import numpy as np
import pytest

from onboard.controller import controller_gains
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle, load_vehicle
from onboard.vehicle.unnamed import CHANNELS, MOST_KNOTS, REGRESSORS, UnnamedCurve
from sim_backend.physics.decision import ThresholdPolicy
from sim_backend.physics.forces import free_flight_wrench
from sim_backend.physics.frames import to_body
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import approaching
from sim_backend.physics.rigid_body import rotation_matrix, unit
from sim_backend.physics.rollout import ROLLOUT, RolloutSettings, rollout
from sim_backend.physics.state import new_state
from sim_backend.physics.step import step_thrust

VEHICLE = load_vehicle("crazyflie21-upgraded-stored")
ROOM = RoomGeometry()
KNOTS = (-2.0, -0.5, 0.4, 1.0, 3.0)
VALUES = (0.01, 0.03, -0.02, -0.02, 0.05)


def curve(
    channel: str, regressor: str, values: tuple[float, ...] = VALUES, knots: tuple[float, ...] = KNOTS
) -> UnnamedCurve:
    return UnnamedCurve(
        channel=channel, regressor=regressor, knots=knots, values=values, sigma=0.0, source="a test"
    )


def parameters(*curves: UnnamedCurve, vehicle: Vehicle = VEHICLE) -> Any:
    return physics_parameters(vehicle.with_unnamed(curves), ROOM)


def a_state() -> Any:
    state = approaching(parameters(), np.array([0.3, -0.7, 1.4]), np.array([0.5, -0.9, 0.2]))
    state["quaternion"] = unit((0.1, -0.2, 0.3, np.sqrt(1.0 - 0.14)))
    state["omega"] = [0.7, -1.2, 0.1]
    return state


def wrench(state: Any, p: Any) -> np.ndarray:
    rot = rotation_matrix(*state["quaternion"])
    return np.array(free_flight_wrench(state, p, rot, *to_body(rot, *state["velocity"])))


def quantities(state: Any) -> dict[str, float]:
    rot = np.array(rotation_matrix(*state["quaternion"])).reshape(3, 3)
    forward, left, up = rot.T @ state["velocity"]
    x, y, z = state["position"]
    found = [x, y, z, ROOM.ceiling_z - z, forward, left, up]
    found += [np.linalg.norm(state["velocity"]), state["velocity"][2], *state["omega"]]
    return dict(zip(REGRESSORS, found, strict=True))


@pytest.mark.parametrize("regressor", REGRESSORS)
def test_a_curve_goes_with_its_quantity(regressor: str) -> None:
    state = a_state()
    x = quantities(state)[regressor]
    added = wrench(state, parameters(curve("force_y", regressor))) - wrench(state, parameters())
    assert added[[0, 2]] == pytest.approx(0.0, abs=1e-15)
    assert added[1] == pytest.approx(np.interp(x, KNOTS, VALUES), abs=1e-15)


@pytest.mark.parametrize("channel", CHANNELS)
def test_a_curve_acts_where_it_says(channel: str) -> None:
    state = a_state()
    rot = np.array(rotation_matrix(*state["quaternion"])).reshape(3, 3)
    axis = np.eye(3)["xyz".index(channel[-1])]
    value = np.interp(state["position"][0], KNOTS, VALUES)
    wanted = np.zeros(6)
    wanted[slice(3, 6) if channel.startswith("torque") else slice(0, 3)] = value * (
        rot.T @ axis if channel.startswith("world") else axis
    )
    added = wrench(state, parameters(curve(channel, "x"))) - wrench(state, parameters())
    assert added == pytest.approx(wanted, abs=1e-15)


@pytest.mark.parametrize("x", [-9.0, -2.0, -1.25, 0.4, 0.7, 3.0, 1e6])
def test_a_curve_is_straight_between_knots_and_constant_beyond(x: float) -> None:
    state = a_state()
    state["position"][0] = x
    every = tuple(np.linspace(-2.0, 3.0, MOST_KNOTS).tolist())
    full = curve("force_x", "x", tuple(np.sin(every).tolist()), every)
    added = wrench(state, parameters(curve("force_x", "x"), full)) - wrench(state, parameters())
    expected = np.interp(x, KNOTS, VALUES) + np.interp(x, every, np.sin(every))
    assert added[0] == pytest.approx(expected, abs=1e-14)


def test_a_force_over_height_gives_as_much_energy_as_its_curve_holds() -> None:
    """A vehicle without thrust and drag climbs past all knots and falls back: nothing is left over."""
    p = parameters(curve("world_force_z", "z", (0.0, 0.1, -0.05), (4.0, 5.0, 6.0)), vehicle=VEHICLE)
    p["ceiling_z"] = 1e3
    state = approaching(p, np.array([0.0, 0.0, 3.0]), np.array([0.2, 0.0, 9.0]))
    state["thrust"], state["omega"] = 0.0, [3.0, 5.0, -2.0]

    def energy() -> float:
        motion = 0.5 * p["mass"] * np.dot(state["velocity"], state["velocity"])
        return float(motion + p["mass"] * p["gravity"] * state["position"][2])

    start, highest = energy(), 0.0
    while state["velocity"][2] > 0.0 or state["position"][2] > 6.0:
        step_thrust(state, p, (0.0, 0.0, 0.0, 0.0), 1e-4)
        highest = max(highest, float(state["position"][2]))
    assert highest > 6.0
    beyond = -0.05 * (state["position"][2] - 6.0)
    assert energy() - start == pytest.approx(0.05 + 0.025 + beyond, abs=2e-5)
    while state["position"][2] > 4.0:
        step_thrust(state, p, (0.0, 0.0, 0.0, 0.0), 1e-4)
    assert energy() == pytest.approx(start, abs=2e-5)


def landing(p: Any) -> bytes:
    state, out = new_state(), np.zeros(1, dtype=ROLLOUT)[0]
    policy, gains = ThresholdPolicy(0.23, -7e-3), controller_gains(VEHICLE)
    rollout(np.random.default_rng(5), state, p, gains, policy, 2.5, 0.7, RolloutSettings(), out)
    return out.tobytes() + state["position"].tobytes()


def test_the_rollouts_of_the_learning_fly_it() -> None:
    near = curve("torque_y", "ceiling_distance", (4e-4, 0.0), (0.1, 0.6))
    assert landing(parameters(near)) != landing(parameters())
    assert landing(parameters(near)) == landing(parameters(near))


def test_a_vehicle_without_curves_takes_the_path_that_it_took() -> None:
    p = parameters()
    assert p["unnamed_count"] == 0
    assert p["forces_on"] == 0
    flat = curve("force_x", "velocity_x", (0.0,) * len(KNOTS))
    plain, zero = a_state(), a_state()
    for _ in range(200):
        step_thrust(plain, parameters(), (0.11, 0.1, 0.09, 0.1), 1e-3)
        step_thrust(zero, parameters(flat), (0.11, 0.1, 0.09, 0.1), 1e-3)
    for field in ("position", "velocity", "quaternion", "omega"):
        np.testing.assert_allclose(zero[field], plain[field], rtol=1e-12, atol=1e-13)
