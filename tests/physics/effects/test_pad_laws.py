"""What a foot that presses needs to take hold: a push, an impulse, an upright rod."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.room import RoomGeometry
from sim_backend.physics.parameters import physics_parameters
from sim_backend.physics.state import FootMode
from sim_backend.physics.step import step_thrust
from tests.drawn_examples import examples
from tests.physics.effects.conftest import Effects, with_effects
from tests.physics.effects.test_contact import upside_down

OFF = (0.0, 0.0, 0.0, 0.0)
ROOM = RoomGeometry()
NEVER = 1.0
"""N s: more than any push has."""


def with_pads(effects: Effects) -> Any:
    return physics_parameters(with_effects(effects), ROOM)


def thrown(
    effects: Effects, climb: float, deviate: float = 0.0, dt: float = 1e-3
) -> tuple[Any, float, float]:
    """State 30 ms after a vehicle upside down was thrown up, impulse (N s) and peak push (N) of a foot."""
    p = with_pads(effects)
    state = upside_down(p, climb)
    state["pad_deviate"] = deviate
    impulse = peak = 0.0
    for _ in range(round(0.03 / dt)):
        before = float(state["foot_impulse"][0])
        step_thrust(state, p, OFF, dt)
        gained = float(state["foot_impulse"][0]) - before
        impulse, peak = impulse + max(gained, 0.0), max(peak, gained / dt)
    return state, impulse, peak


def of_impulse(limit: float, spread: float = 0.0) -> Effects:
    return {"pad_impulse": {"impulse": limit, "spread": spread}}


@settings(max_examples=examples(20))
@given(climb=st.floats(0.5, 2.5))
def test_the_impulse_of_the_feet_is_the_momentum_that_the_ceiling_took(climb: float) -> None:
    """m dv = -J - m g t, four feet alike; nothing else touches while they press."""
    p = with_pads(of_impulse(NEVER))
    state = upside_down(p, climb)
    mass, weight = float(p["mass"]), float(p["mass"] * p["gravity"])
    for _ in range(12):
        step_thrust(state, p, OFF, 1e-3)
        if state["body_contact"] or (state["foot_mode"] == FootMode.FREE).all():
            continue
        took = mass * (climb - float(state["velocity"][2])) - weight * float(state["time"])
        assert state["foot_impulse"].sum() == pytest.approx(took, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("climb", [0.6, 1.2])
def test_a_foot_takes_hold_just_where_its_push_lasts_long_enough(climb: float) -> None:
    _, most, _ = thrown(of_impulse(NEVER), climb)
    mass = float(with_pads({})["mass"])
    assert most > 0.9 * 0.25 * mass * climb  # all of the momentum, and what the rebound adds
    for share, holds in ((0.9, True), (1.1, False)):
        state, _, _ = thrown(of_impulse(share * most), climb)
        assert state["foot_attached"].sum() == (4 if holds else 0)
        assert state["ceiling_contact"]


def test_steps_of_1_ms_take_a_twentieth_of_impulse_and_peak() -> None:
    """Of a push of four milliseconds; halving the step brings both nearer to those of steps of 1/32 ms."""
    found = np.array([thrown(of_impulse(NEVER), 1.0, dt=1e-3 / parts)[1:] for parts in (1, 2, 4, 32)])
    missing = 1.0 - found[:3] / found[3]
    assert np.all(missing[0] < 0.07)
    assert np.all(np.diff(missing, axis=0) < 0.0)
    assert np.all(missing > 0.0)


@pytest.mark.parametrize("climb", [0.6, 1.2])
def test_a_foot_takes_hold_just_where_its_push_is_hard_enough(climb: float) -> None:
    _, _, peak = thrown(of_impulse(NEVER), climb)
    for share, holds in ((0.9, True), (1.1, False)):
        slip: Effects = {"foot_slip": {"minimum_preload": share * peak}}
        state, _, _ = thrown(slip, climb)
        assert state["foot_attached"].sum() == (4 if holds else 0)


def test_a_foot_takes_hold_just_where_its_rod_is_upright_enough() -> None:
    """All four rods lean by the leg's angle where the vehicle comes level, and pressed they lean more."""
    p = with_pads({})
    lean = math.acos(-float(p["leg_direction"][0, 2]))
    for angle, holds in ((lean + 0.02, True), (lean - 0.02, False)):
        state, _, _ = thrown({"pad_angle": {"angle": angle, "spread": 0.0}}, 1.0)
        assert state["foot_attached"].sum() == (4 if holds else 0)


def test_the_deviate_moves_each_limit_by_its_spread_and_a_large_one_is_a_bad_pad() -> None:
    _, impulse, peak = thrown(of_impulse(NEVER), 1.0)
    lean = math.acos(-float(with_pads({})["leg_direction"][0, 2]))
    laws: tuple[Effects, ...] = (
        of_impulse(1.3 * impulse, 0.5 * impulse),
        {"foot_slip": {"minimum_preload": 1.3 * peak, "preload_spread": 0.5 * peak}},
        {"pad_angle": {"angle": lean - 0.15, "spread": 0.25}},
    )
    for law in laws:
        for deviate, holds in ((0.0, False), (-1.0, True), (-5.0, True), (1.0, False), (5.0, False)):
            state, _, _ = thrown(law, 1.0, deviate)
            assert bool(state["foot_attached"].all()) is holds, (law, deviate)


def test_pushes_add_up_until_the_foot_was_clear() -> None:
    """Two pushes without a clearance in between are one; after a clearance it begins anew."""
    p = with_pads(of_impulse(NEVER))
    state = upside_down(p, 0.9)
    for _ in range(4):
        step_thrust(state, p, OFF, 1e-3)
    assert state["foot_impulse"].min() > 0.0
    state["position"][2] -= 0.05
    state["velocity"][2] = -0.1
    step_thrust(state, p, OFF, 1e-3)
    step_thrust(state, p, OFF, 1e-3)
    assert not state["foot_impulse"].any()
    assert (state["foot_mode"] == FootMode.FREE).all()
