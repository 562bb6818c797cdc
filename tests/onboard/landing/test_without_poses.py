"""Poses that stop on the approach, in a brake and in a hold; an estimate that cannot be true."""

import math
from typing import Any

import pytest

from onboard.landing.state_machine import LandingState, OutputMode
from tests.onboard.landing.exact import (
    A_BIT,
    BAD_ESTIMATE,
    GOES_ON,
    POSE_LOST,
    STEP,
    UNKNOWN,
    after,
    exact_rig,
)
from tests.onboard.landing.rig import LIMITS, NAN, Rig

LOW = {"position": (0.0, 0.5, 0.75), "velocity": (0.0, 0.0, -0.1)}
"""Neither at the ceiling nor fast."""
NOT_NUMBERS: list[dict[str, Any]] = [
    {"gyro": (0.0, NAN, 0.0)},
    {"velocity": (0.0, 0.0, NAN)},
    {"velocity": (math.inf, 0.0, 0.0)},
    {"position": (NAN, 0.0, 1.0)},
    {"quaternion": UNKNOWN},
]


@pytest.mark.parametrize(
    ("changes", "end"),
    [
        ({"pose_age": 0.125}, GOES_ON),
        ({"pose_age": 0.125 + A_BIT}, POSE_LOST),
        ({"pose_age": NAN}, POSE_LOST),
        ({"pose_age": math.inf}, POSE_LOST),
        ({"pose_age": 9.0, "velocity": (NAN, 0.0, 0.0)}, BAD_ESTIMATE),
    ],
)
def test_an_approach_says_whether_poses_or_the_estimate_were_lost(changes: dict[str, Any], end: Any) -> None:
    assert after(exact_rig(), 1.0, **changes) == end


@pytest.mark.parametrize("age", [0.2, 9.0, NAN, math.inf])
@pytest.mark.parametrize("where", [Rig.brake, Rig.hold])
def test_without_poses_a_brake_and_a_hold_go_on_by_the_estimate(where: Any, age: float) -> None:
    rig = exact_rig()
    seen = where(exact_rig())
    where(rig)
    state = rig.state
    for _ in range(3):
        output = rig.step(**{**LOW, "time": rig.inputs.time + 1.0, "pose_age": age})
        assert rig.state is state
        assert output.mode == seen.mode


def test_a_blind_brake_holds_and_a_blind_hold_is_handed_over() -> None:
    rig = exact_rig()
    assert after(rig, 1.0, pose_age=0.25) == POSE_LOST
    rig.step(position=(0.0, 0.5, 0.75), velocity=(0.0, 0.0, 0.1))
    assert rig.state is LandingState.HOLD
    rig.step(trajectory_armed=False)
    assert rig.state is LandingState.IDLE


@pytest.mark.parametrize("where", [Rig.brake, Rig.hold])
@pytest.mark.parametrize("useless", [*NOT_NUMBERS, {"velocity": (3.0, 4.0, 0.1)}])
def test_how_long_an_estimate_may_be_useless(where: Any, useless: dict[str, Any]) -> None:
    for late, faulty in ((0.0, False), (STEP, True)):
        rig = exact_rig()
        where(rig)
        state = rig.state
        rig.step(time=rig.inputs.time + 5.0, **LOW)
        assert rig.state is state, "with an estimate it may take as long as it takes"
        known = rig.inputs.time
        rig.step(time=known + 0.25, **useless)
        assert rig.state is state
        rig.step(time=known + 0.5 + late)
        assert rig.state is (LandingState.FAULT if faulty else state)


@pytest.mark.parametrize("where", [Rig.brake, Rig.hold])
def test_an_estimate_that_comes_back_counts_anew(where: Any) -> None:
    rig = exact_rig()
    where(rig)
    state = rig.state
    for _ in range(5):
        rig.step(time=rig.inputs.time + 0.375, **{**LOW, "velocity": (NAN, 0.0, 0.0)})
        rig.step(time=rig.inputs.time + 0.125, **LOW)
    assert rig.state is state


def test_a_brake_for_a_bad_estimate_counts_from_there() -> None:
    for useless, state in ((0.5, LandingState.BRAKE), (0.5 + STEP, LandingState.FAULT)):
        rig = exact_rig()
        assert after(rig, 1.0, velocity=(NAN, 0.0, 0.0)) == BAD_ESTIMATE
        rig.step(time=rig.inputs.time + useless)
        assert rig.state is state


@pytest.mark.parametrize("pose_age", [0.0, 1.0])
@pytest.mark.parametrize(
    ("velocity", "believed"),
    [
        ((3.0, 0.0, -4.0), True),
        ((3.0, 0.0, -4.001), False),
        ((0.0, 5.0, 0.0), True),
        ((0.0, -5.001, 0.0), False),
        ((-3.0, 4.001, 0.0), False),
        ((5.001, 0.0, 0.0), False),
        ((2.0, 3.0, -math.sqrt(12.0) - 1e-3), False),
    ],
)
@pytest.mark.parametrize("where", [Rig.brake, Rig.hold])
def test_how_fast_an_estimate_may_be(where: Any, pose_age: float, velocity: Any, believed: bool) -> None:
    rig = exact_rig()
    where(rig)
    begin, goal = rig.inputs.time, rig.memory["hold_position"]
    place = tuple(float(part) for part in goal) if rig.state is LandingState.HOLD else (0.0, 0.5, 0.75)
    rig.step(pose_age=pose_age, position=place, velocity=velocity)
    assert (rig.memory["usable_time"] == rig.inputs.time) == believed
    assert rig.memory["usable_time"] in (begin, rig.inputs.time)


def believed_in_a_hold(off: tuple[float, float, float], pose_age: float) -> bool:
    """Whether an estimate `off` the setpoint is believed, 1 s after a hold began with 1 m/s sideways."""
    rig = exact_rig()
    rig.hold()
    rig.memory["hold_position"][:] = (0.0, 0.5, 0.75)
    rig.memory["hold_velocity"][:] = (1.0, 0.0, 0.0)
    goal = rig.step(time=rig.inputs.time + 1.0).position
    assert goal == (0.125, 0.5, 0.75)
    place = tuple(part + by for part, by in zip(goal, off, strict=True))
    rig.step(position=place, pose_age=pose_age)
    assert rig.state is LandingState.HOLD
    return bool(rig.memory["usable_time"] == rig.inputs.time)


@pytest.mark.parametrize(
    ("off", "near"),
    [
        ((1.0, 0.0, 0.0), True),
        ((1.001, 0.0, 0.0), False),
        ((-1.001, 0.0, 0.0), False),
        ((0.0, -1.0, 0.0), True),
        ((0.0, 1.001, 0.0), False),
        ((0.0, 0.0, -1.0), True),
        ((0.0, 0.0, -1.001), False),
        ((0.6, 0.6, 0.6), False),
        ((0.57, -0.57, 0.57), True),
        ((0.0, 0.0, NAN), False),
    ],
)
def test_a_blind_hold_is_near_its_setpoint(off: tuple[float, float, float], near: bool) -> None:
    """A filter that was reset says that it is at the origin."""
    assert believed_in_a_hold(off, pose_age=0.25) == near


def test_a_hold_that_sees_may_be_anywhere() -> None:
    """After a long time without poses the estimate jumps to where the drone is."""
    assert believed_in_a_hold((3.0, 0.0, 0.0), pose_age=0.125)
    assert not believed_in_a_hold((3.0, 0.0, 0.0), pose_age=0.125 + A_BIT)


def test_a_brake_may_be_anywhere() -> None:
    rig = exact_rig()
    rig.brake()
    rig.step(time=rig.inputs.time + 1.0, position=(-9.0, 0.5, 0.75), velocity=LOW["velocity"], pose_age=1.0)
    assert rig.state is LandingState.BRAKE
    assert rig.memory["usable_time"] == rig.inputs.time


@pytest.mark.parametrize("useless", NOT_NUMBERS)
def test_a_hold_without_an_estimate_is_level_and_carries_its_weight(useless: dict[str, Any]) -> None:
    rig = Rig()
    rig.hold()
    known = rig.inputs
    output = rig.step(**useless)
    assert rig.state is LandingState.HOLD
    assert (output.mode, output.yaw) == (OutputMode.LEVEL, 0.0)
    assert output.collective == pytest.approx(LIMITS.weight)
    assert output.thrusts == (0.0, 0.0, 0.0, 0.0)
    assert output.position == output.velocity == output.acceleration == (0.0, 0.0, 0.0)
    assert output.attitude == pytest.approx((0.0, 0.0, 0.0, 1.0))
    assert rig.step(**{name: getattr(known, name) for name in useless}).mode == OutputMode.SETPOINT


def test_a_brake_without_an_estimate_takes_all_thrust_away() -> None:
    rig = exact_rig()
    rig.brake()
    output = rig.step(velocity=(NAN, 0.0, 0.0))
    assert (output.mode, output.collective) == (OutputMode.LEVEL, 0.0)


@pytest.mark.parametrize("useless", NOT_NUMBERS)
def test_a_hold_without_an_estimate_is_not_handed_over(useless: dict[str, Any]) -> None:
    rig = exact_rig()
    rig.hold()
    rig.memory["hold_time"] = rig.inputs.time - 9.0
    rig.step(trajectory_armed=False, **{**LOW, **useless})
    assert rig.state is LandingState.HOLD
