"""Estimate and mocap pose are compared at the same time, however fast the drone and however old the pose."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocap_bridge.health import PoseVerdict
from perchhw.supervisor import Phase, SafetyLimits, Tick, step
from perchhw.supervisor.descent import estimate_believable
from perchhw.supervisor.events import Brake
from perchhw.supervisor.gate import GateMemory, admit
from perchhw.supervisor.rules import estimate_agrees_in_flight

from .simulated_attempt import MISSION, good_on_ground
from .states import good_in, state_in

LIMITS = SafetyLimits()
ages, speeds = st.floats(0.0, 0.25), st.floats(-4.0, 4.0)


@given(ages, ages, st.tuples(speeds, speeds, speeds), st.floats(0.0, 2.0))
def test_what_is_compared_is_of_one_time(
    pose_age: float, estimate_age: float, velocity: tuple[float, float, float], off: float
) -> None:
    """A drone in uniform motion, seen `pose_age` and estimated `estimate_age` ago."""
    here = (0.5, -0.2, 1.0)
    seen, estimated = (
        tuple(p - v * age for p, v in zip(here, velocity, strict=True)) for age in (pose_age, estimate_age)
    )
    o = replace(
        good_on_ground(),
        pose_age=pose_age,
        pose_position=(seen[0], seen[1] + off, seen[2]),
        estimate_age=estimate_age,
        estimate_position=(estimated[0], estimated[1], estimated[2]),
        estimate_velocity=velocity,
    )
    assert o.estimate_to_pose == pytest.approx(off, abs=1e-9)


@pytest.mark.parametrize("axis", range(3))
def test_the_distance_is_one_in_space(axis: int) -> None:
    place = [0.0, 0.0, 1.0]
    place[axis] += 0.4
    o = replace(good_on_ground(), pose_position=tuple(place), estimate_position=(0.0, 0.0, 1.0))
    assert o.estimate_to_pose == pytest.approx(0.4)


@pytest.mark.parametrize(
    "name", ["pose_position", "pose_age", "estimate_position", "estimate_velocity", "estimate_age"]
)
def test_what_is_not_known_leaves_it_unknown(name: str) -> None:
    assert replace(good_on_ground(), **{name: None}).estimate_to_pose is None


@pytest.mark.parametrize("off", [0.24, 0.26])
@pytest.mark.parametrize(("ages", "lead"), [({"pose_age": 0.13}, 0.3), ({"pose_age": 0.01}, 0.0)])
def test_an_approach_is_not_ended_by_its_own_speed(ages: dict[str, float], lead: float, off: float) -> None:
    """At 2.5 m/s a pose that is 0.12 s older than the estimate is 0.3 m behind it."""
    changes = {
        "estimate_velocity": (2.5, 0.0, 0.0),
        "estimate_position": (lead, 0.0, 1.0),
        "pose_position": (0.0, off, 1.0),
    }
    o, _ = admit(replace(good_in(Phase.APPROACHING), **ages, **changes), GateMemory(), LIMITS, 0.0)
    violation = estimate_agrees_in_flight(o, LIMITS)
    assert (violation is None) == (off < 0.25)


@pytest.mark.parametrize(("off", "believed"), [(0.99, True), (1.01, False)])
def test_a_descent_is_not_ended_by_its_own_speed(off: float, believed: bool) -> None:
    o = replace(
        good_in(Phase.LANDING),
        pose_age=0.26,
        estimate_velocity=(-4.0, 0.0, 0.0),
        estimate_position=(-1.0, 0.0, 1.0),
        pose_position=(0.0, off, 1.0),
    )
    admitted, _ = admit(o, GateMemory(), LIMITS, 0.0)
    assert (estimate_believable(admitted, LIMITS) is None) == believed


def test_poses_that_are_lost_for_long_end_the_approach_by_their_name() -> None:
    """Up to then the drone breaks it off by itself, and says why."""
    o = replace(
        good_in(Phase.APPROACHING),
        pose_verdict=PoseVerdict.STALE,
        pose_age=0.301,
        estimate_position=MISSION.start,
        estimate_velocity=(0.0, 0.0, 0.0),
    )
    after, orders = step(replace(state_in(Phase.APPROACHING), approach_began=0.0), Tick(o), 0.02, MISSION)
    assert [type(order.command) for order in orders] == [Brake]
    assert (after.aborted_by or "").startswith("pose_age: 0.301 s")
