"""What holds for all effects: they act, they are neutral at their neutral values, and they can be written."""

import dataclasses
import tomllib
from functools import cache
from typing import Any

import numpy as np
import pytest

from onboard.controller import controller_gains
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Vehicle, known_vehicles, load_vehicle, vehicle_to_toml
from onboard.vehicle.file_format import parse_vehicle
from sim_backend.errors import SimulationError
from sim_backend.physics.decision import ThresholdPolicy
from sim_backend.physics.effects import wind
from sim_backend.physics.effects.registry import FIELDS, TERMS, collect_terms
from sim_backend.physics.effects.term import Acts
from sim_backend.physics.parameters import PARAMETERS, physics_parameters
from sim_backend.physics.reset import approaching
from sim_backend.physics.rollout import ROLLOUT, RolloutSettings, rollout
from sim_backend.physics.state import new_state
from sim_backend.physics.step import step, step_thrust
from tests.physics.effects.conftest import typical, with_effects

ROOM = RoomGeometry()
SWITCHES = ("command_on", "motors_on", "forces_on", "sensors_on")


def windy_vehicle() -> Vehicle:
    """The flying vehicle with a little drag, so that a wind has something to act on."""
    vehicle = load_vehicle("crazyflie21-upgraded-stored")
    drag = Quantity(0.005, "N s/m", 0.0, "test case")
    return dataclasses.replace(vehicle, air=dataclasses.replace(vehicle.air, drag_x=drag, drag_y=drag))


def landing(vehicle: Vehicle, switched_on: tuple[str, ...] = ()) -> bytes:
    """What a landing attempt and a crash leave behind, and the state after 0.2 s on the battery."""
    p = physics_parameters(vehicle, ROOM)
    for switch in switched_on:
        p[switch] = 1
    state, out = new_state(), np.zeros(1, dtype=ROLLOUT)[0]
    policy, gains = ThresholdPolicy(0.23, -7e-3), controller_gains(vehicle)
    rollout(np.random.default_rng(5), state, p, gains, policy, 2.5, 0.7, RolloutSettings(), out)
    crash, crashed = new_state(), np.zeros(1, dtype=ROLLOUT)[0]
    late = ThresholdPolicy(0.1, -7e-3)
    rollout(np.random.default_rng(6), crash, p, gains, late, 2.5, 0.7, RolloutSettings(), crashed)
    powered = approaching(p, np.array([0.0, 0.0, 1.5]), np.array([1.0, 0.5, 1.0]))
    for _ in range(200):
        step(powered, p, np.array([0.95, 0.7, 0.75, 1.0]), 1e-3)
    motion = [powered[name].tobytes() for name in ("position", "quaternion", "thrust")]
    end = [state[name].tobytes() for name in ("position", "quaternion", "thrust")]
    return out.tobytes() + crashed.tobytes() + b"".join(motion + end)


@cache
def plain_landing(switched_on: tuple[str, ...] = ()) -> bytes:
    """Without effects, by the code that vehicles with effects behind these switches take."""
    return landing(windy_vehicle(), switched_on)


def test_every_declared_effect_has_an_equation_and_the_other_way_round() -> None:
    assert set(TERMS) == set(EFFECTS)
    names = [field.name for field in FIELDS]
    assert len(names) == len(set(names))
    assert set(names) <= set(PARAMETERS.names or ())


def test_an_effect_has_the_name_of_its_module(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wind, "EFFECT", wind.EFFECT._replace(name="tether"))
    with pytest.raises(SimulationError, match=r"effects/wind\.py: its EFFECT is named 'tether'.*'wind'"):
        collect_terms()


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_changes_the_flight_when_present_and_nothing_when_absent(name: str) -> None:
    """The code behind a switch rounds otherwise, also where nothing in it calls the effect."""
    vehicle = with_effects({name: typical(name)}, windy_vehicle())
    p = physics_parameters(vehicle, ROOM)
    changed = landing(vehicle)
    assert changed != plain_landing(tuple(switch for switch in SWITCHES if p[switch])), "nothing calls it"
    assert landing(vehicle) == changed
    assert landing(dataclasses.replace(vehicle, effects=())) == plain_landing()


@pytest.mark.parametrize("name", EFFECTS)
def test_the_file_gives_the_same_physics(name: str) -> None:
    vehicle = with_effects({name: typical(name)}, windy_vehicle())
    read = parse_vehicle(tomllib.loads(vehicle_to_toml(vehicle)), "copy")
    assert physics_parameters(read, ROOM) == physics_parameters(vehicle, ROOM)
    assert physics_parameters(vehicle, ROOM) != physics_parameters(windy_vehicle(), ROOM)


def tumble(p: Any, side: float = 1.0) -> Any:
    """A powered tumble of 0.15 s below the ceiling; `side` -1 gives its mirror image."""
    state = approaching(p, np.array([0.0, 0.0, 1.7]), np.array([2.0, 0.4 * side, 1.0]))
    state["omega"] = [0.5 * side, -3.0, 1.0 * side]
    right, left = (0.09, 0.11) if side > 0.0 else (0.11, 0.09)
    for k in range(150):
        commands = (right, 0.05, 0.04, left) if side > 0.0 else (right, 0.04, 0.05, left)
        step_thrust(state, p, commands if k > 40 else (0.11, 0.09, 0.09, 0.11), 1e-3)
    return state


@pytest.mark.parametrize("name", [n for n, e in EFFECTS.items() if n != "motor_speed_law"])
def test_an_effect_at_its_neutral_values_does_nothing(name: str) -> None:
    """To rounding: a vehicle with effects takes another path through the same physics."""
    neutral = {
        key: parameter.typical if parameter.neutral is None else parameter.neutral
        for key, parameter in EFFECTS[name].parameters.items()
    }
    neutral.update({"motor_saturation": {"thrust_limit": 1.0}, "tether": {"length": 50.0}}.get(name, {}))
    state = tumble(physics_parameters(with_effects({name: neutral}, windy_vehicle()), ROOM))
    plain = tumble(physics_parameters(windy_vehicle(), ROOM))
    for field in ("position", "velocity", "quaternion", "omega", "thrust"):
        np.testing.assert_allclose(state[field], plain[field], rtol=1e-12, atol=1e-13)


SYMMETRIC = {
    "thrust_scale": {"scale": 0.95},
    "thrust_curve": {"curvature": 0.1},
    "motor_warming": typical("motor_warming"),
    "motor_speed_law": typical("motor_speed_law"),
    "command_delay": {"delay": 0.004},
    "rotor_drag": {"coefficient": 1e-6},
    "linear_drag": {"x": 0.004, "y": 0.004, "z": 0.002},
    "body_drag": {"area_x": 0.003, "area_y": 0.003, "area_z": 0.005},
    "inflow_thrust_loss": {"coefficient": 7.5e-7},
    "translational_lift": {"inflow": 1.0},
    "ceiling_effect": {"inflow": 1.0},
    "ground_effect": {"strength": 5.0},
    "wind": {"x": 0.5, "z": 0.1},
    "velocity_moment": {"roll": 1e-4, "pitch": 1e-4},
    "rate_damping": {"x": 6e-6, "y": 6e-6, "z": 6e-6},
    "rotor_gyroscopic": {"rotor_inertia": 2e-8},
    "rotor_acceleration_torque": {"rotor_inertia": 2e-8},
    "com_offset": {"x": 0.002, "z": -0.003},
    "thrust_tilt": {"x": 0.02},
    "tether": {"x": 1.0, "y": 0.0, "z": 0.0, "length": 1.0, "stiffness": 0.2},
}
"""All effects of flight at once, none of which knows left from right."""


def test_left_and_right_stay_mirror_images_with_all_effects() -> None:
    p = physics_parameters(with_effects(SYMMETRIC), ROOM)
    a, b = tumble(p, 1.0), tumble(p, -1.0)
    np.testing.assert_allclose(a["position"], b["position"] * [1, -1, 1], atol=1e-12)
    np.testing.assert_allclose(a["velocity"], b["velocity"] * [1, -1, 1], atol=1e-12)
    np.testing.assert_allclose(a["omega"], b["omega"] * [-1, 1, -1], atol=1e-10)
    np.testing.assert_allclose(a["thrust"], b["thrust"][[3, 2, 1, 0]], atol=1e-14)
    assert abs(a["position"][1]) > 0.01


def test_known_vehicles_take_the_path_without_effects() -> None:
    """Some have effects of legs and propellers, none an effect of flight."""
    for name in known_vehicles():
        vehicle = load_vehicle(name)
        p = physics_parameters(vehicle, ROOM)
        assert not any(p[switch] for switch in SWITCHES)
        own = {field.name for effect in vehicle.effects for field in TERMS[effect.name].fields}
        for field in FIELDS:
            if field.name in own:
                continue
            np.testing.assert_array_equal(p[field.name], np.full(field.shape, field.default))


def test_effects_that_act_once_switch_nothing_on() -> None:
    once = {name: typical(name) for name, term in TERMS.items() if term.acts is Acts.ONCE}
    assert {"mass_error", "battery_sag", "motor_lag", "leg_stiffness"} <= set(once)
    p = physics_parameters(with_effects(once), ROOM)
    assert not any(p[switch] for switch in SWITCHES)
