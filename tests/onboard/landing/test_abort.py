"""Aborts, and approaches that go wrong."""

from typing import Any

import pytest

from onboard.landing.state_machine import (
    EndReason,
    LandingState,
    OutputMode,
)
from onboard.trajectory import (
    sample_approach,
)
from tests.onboard.landing.rig import LEVEL, LIMITS, NAN, PLAN, Rig


def test_abort_from_every_state() -> None:
    idle = Rig()
    idle.step(abort=True)
    assert idle.state is LandingState.IDLE
    idle.step(trajectory_armed=True)
    assert idle.state is LandingState.IDLE, "no arming while an abort stands"

    armed = Rig()
    armed.step(trajectory_armed=True)
    armed.step(abort=True, go=True)
    assert armed.state is LandingState.IDLE

    approach = Rig()
    approach.approach(PLAN.impact_time - 0.251, policy_armed=True)
    output = approach.step(**approach.trigger_sample(), abort=True)
    assert (approach.state, approach.reason) == (LandingState.BRAKE, EndReason.ABORT)
    assert (output.mode, output.collective) == (OutputMode.LEVEL, 0.0)

    flip = Rig()
    flip.flip()
    assert flip.step(abort=True).mode == OutputMode.OFF
    assert flip.state is LandingState.CUT
    flip.step(abort=True)
    assert flip.state is LandingState.CUT

    for make in (Rig.brake, Rig.hold):
        rig = Rig()
        make(rig)
        before = rig.state
        rig.step(abort=True)
        assert rig.state is before


def test_disarming_in_the_approach_brakes() -> None:
    rig = Rig()
    rig.approach(1.0)
    rig.step(trajectory_armed=False)
    assert (rig.state, rig.reason) == (LandingState.BRAKE, EndReason.DISARMED)


@pytest.mark.parametrize(
    ("changes", "state", "reason"),
    [
        ({"pose_age": 0.151}, LandingState.BRAKE, EndReason.POSE_LOST),
        ({"position": (0.0, 0.0, NAN)}, LandingState.BRAKE, EndReason.BAD_ESTIMATE),
        ({"gyro": (NAN, 0.0, 0.0)}, LandingState.BRAKE, EndReason.BAD_ESTIMATE),
        ({"position": (-1.0, 0.51, 1.0)}, LandingState.BRAKE, EndReason.OFF_TRACK),
        ({"position": (0.0, 0.0, 2.08)}, LandingState.BRAKE, EndReason.CONTACT),
        ({"flying": False}, LandingState.CUT, EndReason.NOT_FLYING),
    ],
)
def test_what_ends_an_approach(changes: dict[str, Any], state: LandingState, reason: EndReason) -> None:
    rig = Rig()
    rig.approach(1.0)
    rig.step(**changes)
    assert (rig.state, rig.reason) == (state, reason)


def test_tilt_in_the_approach_cuts() -> None:
    rig = Rig()
    rig.approach(1.0)
    for _ in range(200):
        rig.step(gyro=(0.0, 10.0, 0.0), quaternion=LEVEL)
        if rig.state is not LandingState.APPROACH:
            break
    assert (rig.state, rig.reason) == (LandingState.CUT, EndReason.TILT)


def test_an_approach_that_never_arrives_is_ended() -> None:
    rig = Rig()
    rig.approach(1.0, policy_armed=True)
    late = rig.inputs.time + PLAN.impact_time - 1.0
    rig.step(time=late + 0.49, position=(0.0, 0.0, 1.0), velocity=(0.0, 0.0, 0.0))
    assert rig.state is LandingState.APPROACH
    rig.step(time=late + 0.51)
    assert (rig.state, rig.reason) == (LandingState.BRAKE, EndReason.OFF_TRACK)


def test_missed_trigger_brakes_once_the_next_look_would_be_below_the_policys_range() -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.2161, policy_armed=True, evaluated=True)
    assert rig.state is LandingState.APPROACH
    position, velocity, _ = sample_approach(PLAN, PLAN.impact_time - 0.2159)
    rig.step(position=position, velocity=velocity)
    assert (rig.state, rig.reason) == (LandingState.BRAKE, EndReason.MISSED_TRIGGER)


def test_before_the_policy_has_looked_it_brakes_below_the_range_itself() -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.2061, policy_armed=True, evaluated=False)
    assert rig.state is LandingState.APPROACH
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.2059, policy_armed=True, evaluated=False)
    assert rig.state is LandingState.BRAKE


def test_a_trigger_in_the_last_look_counts() -> None:
    rig = Rig()
    rig.approach(PLAN.impact_time - 0.3, policy_armed=True)
    position, velocity, _ = sample_approach(PLAN, PLAN.impact_time - 0.207)
    rig.step(**{**rig.trigger_sample(), "position": position, "velocity": velocity})
    assert rig.state is LandingState.FLIP


@pytest.mark.parametrize("tau_min", [NAN, 0.0, -1.0])
def test_without_a_known_range_the_stopping_distance_decides(tau_min: float) -> None:
    limits = LIMITS._replace(policy_tau_min=tau_min)
    rig = Rig(limits=limits)
    rig.approach(PLAN.impact_time - 0.3, policy_armed=True)
    assert rig.state is LandingState.APPROACH
    rig = Rig(limits=limits)
    rig.approach(PLAN.impact_time - 0.22, policy_armed=True)
    assert (rig.state, rig.reason) == (LandingState.BRAKE, EndReason.MISSED_TRIGGER)
