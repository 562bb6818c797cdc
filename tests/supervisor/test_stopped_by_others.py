"""A drone that somebody else stops: known as stopped, and its approach as no failure of the policy."""

from dataclasses import replace

import pytest

from onboard.app_interface import EndReason, LandingState
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import Phase, Tick, step

from .simulated_attempt import FLYING, PERIOD
from .states import ALL_PHASES, BEFORE_ARMING, good_in, mission_of, state_in

LOCKED = SupervisorInfo(FLYING | SupervisorBits.LOCKED)


@pytest.mark.parametrize(
    ("reason", "aborted_by"),
    [
        (EndReason.TRIGGERED, None),
        (EndReason.CONTACT, None),
        (EndReason.TILT, None),
        (EndReason.NOT_FLYING, "drone_broke_off: not_flying"),
        (EndReason.ABORT, "drone_broke_off: abort"),
        (EndReason.NONE, "drone_broke_off: none"),
        (None, "drone_broke_off: unknown"),
    ],
)
def test_motors_that_are_cut_without_a_trigger_say_why(
    reason: EndReason | None, aborted_by: str | None
) -> None:
    o = replace(
        good_in(Phase.APPROACHING), landing_state=LandingState.CUT, end_reason=reason, trigger_count=0
    )
    state = step(state_in(Phase.APPROACHING), Tick(o), PERIOD, mission_of(Phase.APPROACHING)).state
    assert (state.phase, state.triggered, state.aborted_by) == (Phase.SETTLING, False, aborted_by)


def test_a_trigger_that_was_counted_is_no_abort_whatever_else_is_said() -> None:
    o = replace(
        good_in(Phase.APPROACHING),
        landing_state=LandingState.CUT,
        end_reason=EndReason.ABORT,
        trigger_count=1,
    )
    state = step(state_in(Phase.APPROACHING), Tick(o), PERIOD, mission_of(Phase.APPROACHING)).state
    assert (state.phase, state.triggered, state.aborted_by) == (Phase.SETTLING, True, None)


@pytest.mark.parametrize("phase", ALL_PHASES)
def test_a_lock_that_is_not_ours_is_remembered(phase: Phase) -> None:
    o = replace(good_in(phase), drone=LOCKED)
    state = step(state_in(phase), Tick(o), PERIOD, mission_of(phase)).state
    ours = (*BEFORE_ARMING, Phase.STOPPING, Phase.DISARMING)
    assert state.locked is (phase not in ours)
    assert step(state, Tick(good_in(phase)), 2 * PERIOD, mission_of(phase)).state.locked is state.locked


@pytest.mark.parametrize("phase", ALL_PHASES)
def test_a_drone_that_flies_was_stopped_by_nobody(phase: Phase) -> None:
    assert not step(state_in(phase), Tick(good_in(phase)), PERIOD, mission_of(phase)).state.locked
