"""A drone that somebody else stops: known as stopped, and its approach as no failure of the policy."""

from dataclasses import replace
from typing import Any

import pytest

from onboard.app_interface import EndReason, LandingState
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import Phase, Tick, step
from perchhw.supervisor.events import Arm, CommandFailed, Order
from perchhw.supervisor.machine import STOPPED_BY_OTHERS

from .simulated_attempt import FLYING, PERIOD
from .states import ALL_PHASES, BEFORE_ARMING, DESCENDING, HOVERING, good_in, mission_of, state_in

LOCKED = SupervisorInfo(FLYING | SupervisorBits.LOCKED)


@pytest.mark.parametrize(
    ("reason", "aborted_by"),
    [
        (EndReason.TRIGGERED, None),
        (EndReason.CONTACT, "drone_broke_off: contact"),
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
    assert state.locked is (phase not in (*BEFORE_ARMING, Phase.STOPPING))
    assert step(state, Tick(good_in(phase)), 2 * PERIOD, mission_of(phase)).state.locked is state.locked


@pytest.mark.parametrize(("after", "others"), [(0.5, True), (0.52, False)])
def test_the_drones_own_watchdog_locks_it_while_it_is_disarmed_and_nobody_stopped_it(
    after: float, others: bool
) -> None:
    o = replace(good_in(Phase.DISARMING), drone=LOCKED)
    state = step(state_in(Phase.DISARMING), Tick(o), after, mission_of(Phase.DISARMING)).state
    assert state.locked is others


@pytest.mark.parametrize("phase", [*HOVERING, Phase.APPROACHING, *DESCENDING])
def test_a_stop_shows_first_as_a_drone_that_cannot_fly_and_is_named_all_the_same(phase: Phase) -> None:
    """The firmware passes through a state of 40 ms in which it neither flies nor is locked."""
    mission, falling = mission_of(phase), SupervisorInfo(FLYING & ~SupervisorBits.CAN_FLY)
    state = step(state_in(phase), Tick(replace(good_in(phase), drone=falling)), PERIOD, mission).state
    assert state.locked
    if phase in DESCENDING:
        assert state.aborted_by is None
    else:
        assert state.aborted_by == "drone_can_fly: no, need yes" + STOPPED_BY_OTHERS
    again = step(state, Tick(replace(good_in(phase), drone=LOCKED)), 2 * PERIOD, mission).state
    assert str(again.aborted_by).count(STOPPED_BY_OTHERS) == (again.aborted_by is not None)


def test_a_landing_that_a_stop_of_others_ended_is_not_called_the_hosts_doing() -> None:
    mission, falling = mission_of(Phase.MOVING_TO_START), SupervisorInfo(FLYING & ~SupervisorBits.CAN_FLY)
    lands = step(
        state_in(Phase.MOVING_TO_START),
        Tick(replace(good_in(Phase.MOVING_TO_START), drone=falling)),
        PERIOD,
        mission,
    )
    (order,) = lands.orders
    state = step(lands.state, CommandFailed(order, "supervisor says high_level_active"), 0.1, mission).state
    assert state.phase is Phase.STOPPING
    assert "the host did it" not in str(state.fell)
    assert "somebody else stopped the drone" in str(state.fell)


@pytest.mark.parametrize(
    ("changes", "sign"),
    [
        ({}, "drone_state: locked, need upright and unlocked (reboot the drone on its start mark)"),
        (
            {"landing_state": LandingState.CUT, "end_reason": EndReason.NOT_FLYING, "trigger_count": 0},
            "drone_broke_off: not_flying",
        ),
    ],
)
def test_whatever_notices_the_stop_of_others_says_so(changes: dict[str, Any], sign: str) -> None:
    o = replace(good_in(Phase.APPROACHING), drone=LOCKED, **changes)
    state = step(state_in(Phase.APPROACHING), Tick(o), PERIOD, mission_of(Phase.APPROACHING)).state
    assert state.aborted_by == sign + STOPPED_BY_OTHERS


def test_a_stop_that_comes_while_it_is_armed_is_the_reason_why_it_does_not_arm() -> None:
    """The order fails in the 40 ms before the drone is locked; that it is, is seen when it is disarmed."""
    mission, refused = mission_of(Phase.ARMING), "the drone does not arm: supervisor says high_level_finished"
    failed = step(state_in(Phase.ARMING), CommandFailed(Order(7, Arm()), refused), 0.1, mission)
    assert (failed.state.phase, failed.state.aborted_by) == (Phase.DISARMING, f"Arm failed: {refused}")
    o = replace(good_in(Phase.DISARMING), drone=LOCKED)
    state = step(failed.state, Tick(o), 0.1 + PERIOD, mission).state
    assert (state.locked, state.aborted_by) == (True, f"Arm failed: {refused}{STOPPED_BY_OTHERS}")


@pytest.mark.parametrize("lies", [SupervisorBits.TUMBLED, SupervisorBits.CRASHED])
@pytest.mark.parametrize("phase", ALL_PHASES)
def test_a_drone_that_lies_on_its_back_was_stopped_by_nobody(phase: Phase, lies: SupervisorBits) -> None:
    o = replace(good_in(phase), drone=SupervisorInfo(FLYING & ~SupervisorBits.CAN_FLY | lies))
    assert not step(state_in(phase), Tick(o), PERIOD, mission_of(phase)).state.locked


@pytest.mark.parametrize("phase", [Phase.ARMING, Phase.FLIPPING, Phase.SETTLING, Phase.DISARMING])
def test_motors_that_need_not_turn_were_stopped_by_nobody(phase: Phase) -> None:
    o = replace(good_in(phase), drone=SupervisorInfo(FLYING & ~SupervisorBits.CAN_FLY))
    assert not step(state_in(phase), Tick(o), PERIOD, mission_of(phase)).state.locked


@pytest.mark.parametrize("phase", ALL_PHASES)
def test_a_drone_that_flies_was_stopped_by_nobody(phase: Phase) -> None:
    assert not step(state_in(phase), Tick(good_in(phase)), PERIOD, mission_of(phase)).state.locked
