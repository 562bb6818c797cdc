"""Limits of flip, brake and hold, just inside, just outside, and at them."""

from typing import Any

import pytest

from onboard.landing.state_machine import LandingState, OutputMode
from tests.onboard.landing.exact import (
    A_BIT,
    EXACT_LIMITS,
    EXACT_PLAN,
    STEP,
    exact_rig,
    tip_over,
)
from tests.onboard.landing.rig import LEVEL, LIMITS, NAN, PLAN, Rig


def test_a_flip_may_take_its_time_and_no_more() -> None:
    for late, state in ((0.0, LandingState.FLIP), (STEP, LandingState.CUT)):
        rig = exact_rig()
        rig.approach(EXACT_PLAN.impact_time - 0.375, policy_armed=True)
        rig.step(**rig.trigger_sample())
        assert rig.state is LandingState.FLIP
        rig.step(time=rig.inputs.time + 0.5 + late)
        assert rig.state is state


@pytest.mark.parametrize("pose_age", [0.01, 0.3])
@pytest.mark.parametrize("where", [Rig.brake, Rig.hold])
def test_contact_drops_no_drone_that_is_upright(where: Any, pose_age: float) -> None:
    rig = Rig()
    where(rig)
    state = rig.state
    for left in (1.02 * LIMITS.contact_distance, 0.98 * LIMITS.contact_distance, 0.0, -0.02):
        rig.step(position=(0.0, 0.0, PLAN.ceiling_z - left), velocity=(0.0, 0.0, 0.5), pose_age=pose_age)
        assert rig.state is state


def test_what_touched_the_ceiling_in_a_brake_is_caught_once_it_falls() -> None:
    rig = Rig()
    rig.brake()
    output = rig.step(position=(0.0, 0.0, PLAN.ceiling_z), velocity=(0.0, 0.0, 0.1), abort=False)
    assert (output.mode, output.collective) == (OutputMode.LEVEL, 0.0)
    output = rig.step(velocity=(0.0, 0.0, -0.6))
    assert (rig.state, output.mode) == (LandingState.HOLD, OutputMode.SETPOINT)
    assert output.velocity == (0.0, 0.0, -LIMITS.descent_speed)
    tipped = Rig()
    tipped.brake()
    tipped.step(position=(0.0, 0.0, PLAN.ceiling_z), **tip_over(80.0))
    assert tipped.state is LandingState.CUT


def test_what_is_not_known_does_not_end_a_brake() -> None:
    rig = Rig()
    rig.brake()
    rig.step(velocity=(0.0, 0.0, -0.6), gyro=(NAN, 0.0, 0.0), abort=False)
    assert rig.state is LandingState.BRAKE


@pytest.mark.parametrize(
    ("end", "state"),
    [
        (tip_over(71.0), LandingState.CUT),
        ({**tip_over(80.0), "quaternion": LEVEL}, LandingState.CUT),
        ({"time": 1e3, "velocity": (NAN, 0.0, 0.0)}, LandingState.FAULT),
    ],
)
def test_a_disarmed_hold_that_ends_badly_is_not_handed_back(end: dict[str, Any], state: LandingState) -> None:
    rig = Rig()
    rig.hold()
    rig.step(trajectory_armed=False, **end)
    assert rig.state is state


@pytest.mark.parametrize(
    ("climb", "holds"), [(-0.49, False), (-0.5, True), (-0.51, True), (-0.2, False), (0.0, False)]
)
def test_a_brake_has_done_its_work_when_the_vehicle_falls(climb: float, holds: bool) -> None:
    rig = Rig()
    rig.brake()
    rig.step(position=(0.0, 0.0, 1.0), velocity=(0.0, 0.0, climb), abort=False)
    assert (rig.state is LandingState.HOLD) == holds


@pytest.mark.parametrize("climb", [0.1, 0.5, 1.0, 2.0])
def test_a_brake_low_enough_holds_at_once(climb: float) -> None:
    """Low enough: 0.15 s and a stop with the hold's acceleration end below the height of the hold."""
    highest = PLAN.ceiling_z - 0.7 - 0.15 * climb - climb**2 / (2 * 4.0)
    for off, holds in ((-1e-3, True), (1e-3, False)):
        rig = Rig()
        rig.brake()
        rig.step(position=(0.0, 0.0, highest + off), velocity=(0.0, 0.0, climb), abort=False)
        assert (rig.state is LandingState.HOLD) == holds


def test_a_brake_that_would_end_at_the_height_of_the_hold_holds() -> None:
    limits = EXACT_LIMITS._replace(hold_clearance=0.5, hold_acceleration=4.0)
    rise_left = 0.5 * (0.15 + 0.5 * 0.5 / 4.0)
    height = EXACT_PLAN.ceiling_z - 0.5 - rise_left
    assert height + rise_left == EXACT_PLAN.ceiling_z - 0.5
    for off, state in ((0.0, LandingState.HOLD), (A_BIT, LandingState.BRAKE)):
        rig = exact_rig(limits)
        rig.brake()
        rig.step(position=(0.0, 0.5, height + off), velocity=(0.0, 0.0, 0.5), abort=False)
        assert rig.state is state
