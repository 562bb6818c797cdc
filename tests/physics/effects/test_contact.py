"""Pads: which touches stick, what the others do, and what a pad that is turned takes."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.controller import controller_gains
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from sim_backend.physics.decision import ThresholdPolicy
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.reset import approaching
from sim_backend.physics.rollout import ROLLOUT, RolloutSettings, rollout
from sim_backend.physics.state import FootMode, new_state
from sim_backend.physics.step import step_thrust
from tests.physics.effects.conftest import Effects, with_effects
from tests.physics.energy import mechanical_energy
from tests.tiers import some

OFF = (0.0, 0.0, 0.0, 0.0)
ROOM = RoomGeometry()
FEET_DOWN = np.array([1.0, 0.0, 0.0, 0.0])
"""Attitude upside down: all four feet towards the ceiling."""


def upside_down(p: Any, climb: float) -> Any:
    """A vehicle upside down just below the ceiling that climbs, motors off."""
    feet = float(p["hip"][0, 2] + p["leg_length"] * p["leg_direction"][0, 2])
    height = ROOM.ceiling_z + feet - float(p["foot_radius"])
    state = approaching(p, np.array([0.0, 0.0, height - 2e-3]), np.array([0.0, 0.0, climb]))
    state["quaternion"], state["thrust"] = FEET_DOWN, 0.0
    return state


def with_pads(effects: Effects) -> Any:
    return physics_parameters(with_effects(effects), ROOM)


@given(climb=st.floats(0.4, 3.0), speed=st.floats(0.1, 3.0))
def test_a_foot_sticks_just_where_it_comes_as_fast_as_its_pad_asks(climb: float, speed: float) -> None:
    p = with_pads({"pad_capture": {"speed": speed, "spread": 0.0}})
    state = upside_down(p, climb)
    distance, g = 2e-3, float(p["gravity"])
    arrival = math.sqrt(climb**2 - 2.0 * g * distance)
    if abs(arrival - speed) < 1e-3:
        return
    for _ in range(15):
        step_thrust(state, p, OFF, 1e-3)
    assert state["foot_attached"].sum() == (4 if arrival > speed else 0)
    assert state["ceiling_contact"]


def test_the_deviate_moves_the_limit_by_the_spread() -> None:
    p = with_pads({"pad_capture": {"speed": 1.0, "spread": 0.5}})
    for deviate, holds in ((0.0, False), (-0.5, True), (-3.0, True), (2.0, False)):
        state = upside_down(p, 0.9)
        state["pad_deviate"] = deviate
        for _ in range(15):
            step_thrust(state, p, OFF, 1e-3)
        assert bool(state["foot_attached"].all()) is holds


def test_a_foot_that_did_not_stick_cannot_catch_in_the_same_push_but_can_after_it_was_clear() -> None:
    p = with_pads({"pad_capture": {"speed": 1.0, "spread": 0.0}})
    state = upside_down(p, 0.9)
    state["thrust"] = 0.0
    for _ in range(20):
        step_thrust(state, p, OFF, 1e-3)
        if (state["foot_mode"] == FootMode.PRESSING_CEILING).all():
            break
    assert state["foot_refused"].all()
    # Faster now, in the same push: they press on.
    state["velocity"][2] = 2.0
    step_thrust(state, p, OFF, 1e-3)
    assert not state["foot_attached"].any()
    assert (state["foot_mode"] == FootMode.PRESSING_CEILING).all()
    # Away, and back as fast as it takes.
    state["position"][2] -= 0.05
    state["velocity"][2] = -0.1
    step_thrust(state, p, OFF, 1e-3)
    step_thrust(state, p, OFF, 1e-3)
    assert not state["foot_refused"].any()
    state["velocity"][2] = 2.0
    for _ in range(60):
        step_thrust(state, p, OFF, 1e-3)
    assert state["foot_attached"].all()


@pytest.mark.parametrize("speed", [0.0, 0.8, 100.0])
def test_feet_that_hold_are_in_the_ceilings_plane_and_the_vehicle_below_it(speed: float) -> None:
    p = with_pads({"pad_capture": {"speed": speed, "spread": 0.0}})
    rng = np.random.default_rng(4)
    plane = ROOM.ceiling_z - float(p["foot_radius"])
    for _ in range(20):
        state = upside_down(p, rng.uniform(0.3, 3.0))
        state["position"][2] -= 0.05
        state["velocity"][:2], state["omega"] = rng.uniform(-1.0, 1.0, 2), rng.uniform(-8.0, 8.0, 3)
        for _ in range(300):
            step_thrust(state, p, OFF, 1e-3)
            held = state["foot_mode"] == FootMode.ATTACHED
            assert np.all(np.abs(state["foot_anchor"][held, 2] - plane) < 1e-4)
            assert not held[state["foot_refused"] == 1].any()
            assert state["position"][2] < ROOM.ceiling_z


def attempt(effects: Effects, seed: int) -> tuple[bytes, int]:
    """Everything that a rollout leaves behind, and the feet that hold."""
    p = with_pads(effects)
    state, out = new_state(), np.zeros(1, dtype=ROLLOUT)[0]
    gains = controller_gains(load_vehicle("crazyflie21-upgraded-stored"))
    rng = np.random.default_rng(seed)
    rollout(rng, state, p, gains, ThresholdPolicy(0.23, -7e-3), 2.8, 0.8, RolloutSettings(), out)
    motion = state["position"].tobytes() + state["quaternion"].tobytes() + rng.bytes(8)
    return out.tobytes() + motion, int(out["feet"])


@pytest.mark.parametrize("seed", some(range(20), 5))
def test_pads_that_always_stick_leave_every_bit_as_it_was(seed: int) -> None:
    neutral: Effects = {"pad_capture": {"speed": 0.0, "spread": 0.0}, "pad_damping": {"coefficient": 0.0}}
    assert attempt(neutral, seed) == attempt({}, seed)


def test_the_seed_draws_the_pads() -> None:
    scattered: Effects = {"pad_capture": {"speed": 0.5, "spread": 0.5}, "leg_damping": {"scale": 8.0}}
    feet = [attempt(scattered, seed) for seed in range(40)]
    assert feet == [attempt(scattered, seed) for seed in range(40)]
    assert len({held for _, held in feet}) > 1


def test_a_pad_that_is_turned_takes_energy_and_never_gives_any() -> None:
    """Swings on two feet without other losses: the decay grows with the coefficient, and is none without."""
    left = []
    for coefficient in (0.0, 8e-5, 3e-4):
        p = with_pads({"pad_damping": {"coefficient": coefficient}, "leg_damping": {"scale": 0.0}})
        p["axial_damping"] = 0.0
        state = hanging_on_two(p)
        start = mechanical_energy(state, p)
        lowest = start
        for _ in range(600):
            step_thrust(state, p, OFF, 2.5e-4)
            energy = mechanical_energy(state, p)
            assert energy < lowest + 2e-6
            lowest = min(lowest, energy)
        left.append((start - lowest) / start)
    assert left[0] < 0.2 * left[1]
    assert left[1] < 0.5 * left[2]


def hanging_on_two(p: Any) -> Any:
    """A vehicle on its two front feet that swings."""
    state = upside_down(p, 0.0)
    feet = p["hip"] + p["leg_length"] * p["leg_direction"]
    state["position"][2] += 2e-3
    for leg in (0, 3):
        state["foot_mode"][leg], state["foot_attached"][leg] = FootMode.ATTACHED, 1
        state["foot_anchor"][leg] = state["position"] + feet[leg] * [1.0, -1.0, -1.0]
    state["omega"][1] = 1.0
    return state
