"""Flip and cut."""

import math
from typing import Any

import pytest

from onboard.landing.state_machine import (
    LandingState,
    OutputMode,
)
from onboard.rotation import from_rotation_vector
from tests.onboard.landing.rig import LEVEL, NAN, PLAN, UPSIDE_DOWN, Rig, steps_until_cut

QUARTER_TURN = math.ceil(math.pi / 2 / 20.0 / 1e-3)


def test_motors_stop_when_the_body_axis_reaches_the_horizon() -> None:
    rig = Rig()
    rig.flip()
    assert steps_until_cut(rig) == QUARTER_TURN


@pytest.mark.parametrize(
    "bad",
    [
        {20: {"quaternion": UPSIDE_DOWN}},
        {20: {"quaternion": (0.0, -0.7, 0.0, 0.7)}},
        {k: {"quaternion": LEVEL} for k in range(1, 200)},
        {k: {"quaternion": (NAN, NAN, NAN, NAN)} for k in range(5, 200)},
        {k: {"position": (9.0, 9.0, 9.0), "velocity": (NAN, 0.0, 0.0)} for k in range(5, 200)},
        {k: {"pose_age": 1.0} for k in range(1, 200)},
    ],
)
def test_bad_poses_in_the_flip_cannot_move_the_cut(bad: dict[int, dict[str, Any]]) -> None:
    rig = Rig()
    rig.flip()
    assert steps_until_cut(rig, bad=bad) == QUARTER_TURN


@pytest.mark.parametrize("jump", [UPSIDE_DOWN, (0.0, 0.6, 0.0, 0.8), (0.5, -0.5, 0.5, 0.5)])
def test_a_bad_pose_before_the_trigger_moves_the_cut_by_no_more_than_a_step(jump: Any) -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.262, policy_armed=True)
    for _ in range(10):
        rig.step(quaternion=jump)
    rig.step(**rig.trigger_sample(), quaternion=LEVEL)
    assert rig.state is LandingState.FLIP
    assert abs(steps_until_cut(rig) - QUARTER_TURN) <= 1


def test_own_attitude_follows_the_estimate_outside_the_flip() -> None:
    rig = Rig()
    rig.step()
    rig.approach(0.5)
    wanted = from_rotation_vector((0.0, 0.1, 0.0))
    for _ in range(900):
        output = rig.step(quaternion=wanted)
    assert output.attitude == pytest.approx(wanted, abs=2e-3)


def test_a_flip_that_does_not_turn_is_cut() -> None:
    rig = Rig()
    rig.flip()
    count = 0
    while rig.state is LandingState.FLIP:
        rig.step()
        count += 1
        assert count < 510
    assert rig.state is LandingState.CUT
    assert count >= 499


def test_a_gyro_that_is_lost_in_the_flip_cuts() -> None:
    rig = Rig()
    rig.flip()
    rig.step(gyro=(NAN, 0.0, 0.0))
    assert rig.state is LandingState.CUT


def test_the_cut_is_latched_until_disarmed_and_down() -> None:
    rig = Rig()
    rig.flip()
    steps_until_cut(rig)
    for changes in (
        {"trajectory_armed": False},
        {"policy_armed": False},
        {"trajectory_armed": True, "go": True, "flying": False},
        {"go": False, "quaternion": LEVEL},
    ):
        assert rig.step(**changes).mode == OutputMode.OFF
        assert rig.state is LandingState.CUT
    assert rig.step(trajectory_armed=False).mode == OutputMode.PASS
    assert rig.state is LandingState.IDLE
