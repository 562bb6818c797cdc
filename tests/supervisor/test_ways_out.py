"""What leaves a phase behind it: what is forgotten, what is remembered first, and what the operator gets."""

from dataclasses import replace

import pytest

from onboard.app_interface import LandingState
from perchhw.supervisor import (
    CommandFailed,
    LinkDown,
    OperatorAbort,
    Order,
    Phase,
    RecordLost,
    StopUnconfirmed,
    Tick,
    Timing,
    step,
)
from perchhw.supervisor.events import URGENT_COMMANDS, Arm, Brake, Disarm, EmergencyStop, Land, StartApproach

from .simulated_attempt import MISSION, PERIOD
from .states import ALL_PHASES, BEFORE_ARMING, HOVERING, good_in, mission_of, state_in

ENTERED: dict[Phase, tuple[Phase, type, str]] = {
    Phase.ARMING: (Phase.DISARMING, Disarm, "the motors to be disarmed"),
    **dict.fromkeys(HOVERING, (Phase.LANDING, Land, "the drone to reach the floor")),
    Phase.APPROACHING: (Phase.BRAKING, Brake, "the drone to brake"),
}
"""Where a first Ctrl-C leads from each phase, what it orders, and what is then waited for."""


BRAKES = replace(good_in(Phase.APPROACHING), landing_state=LandingState.BRAKE)
"""The drone has broken off its approach by itself."""


@pytest.mark.parametrize("phase", list(ENTERED))
def test_a_new_phase_begins_with_nothing_of_the_old_one(phase: Phase) -> None:
    old = replace(state_in(phase), good_since=0.05, bad_since=0.05, answered_at=0.05, waiting_for="old")
    state, orders = step(old, OperatorAbort(), 0.1, mission_of(phase))
    then, command, words = ENTERED[phase]
    assert (state.phase, [type(order.command) for order in orders]) == (then, [command])
    assert (state.good_since, state.bad_since, state.answered_at) == (None, None, None)
    assert (state.entered_at, state.waiting_for) == (0.1, words)
    assert (state.oldest_in_force, state.orders_given) == (8, 8)


def test_what_ends_a_flight_does_not_wait_behind_other_commands() -> None:
    braking = step(state_in(Phase.APPROACHING), Tick(BRAKES), PERIOD, MISSION).orders
    by_the_drone = {type(order.command) for order in braking}
    assert set(URGENT_COMMANDS) == {command for _, command, _ in ENTERED.values()} | by_the_drone


def test_a_stop_says_what_it_waits_for() -> None:
    state, _ = step(state_in(Phase.LANDING), OperatorAbort(urgent=True), 0.1, MISSION)
    assert state.waiting_for == "the drone to report locked motors"


def test_the_landing_has_the_time_of_its_descent() -> None:
    _, (order,) = step(state_in(Phase.MOVING_TO_START), OperatorAbort(), 0.1, MISSION)
    assert order.command == Land(Timing().land)


def test_who_ordered_the_motors_to_arm_stops_them_when_the_link_breaks() -> None:
    mission = mission_of(Phase.READY)
    state, orders = step(state_in(Phase.READY), Tick(good_in(Phase.READY)), mission.arm_at, mission)
    assert [type(order.command) for order in orders] == [Arm]
    assert state.arm_ordered
    state, orders = step(state, LinkDown("silent"), mission.arm_at + 0.01, mission)
    assert [type(order.command) for order in orders] == [EmergencyStop]
    assert (state.phase, state.arm_ordered) == (Phase.STOPPING, True)


# --- the operator -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", BEFORE_ARMING)
@pytest.mark.parametrize("urgent", [False, True])
def test_before_the_motors_were_armed_an_attempt_just_ends(phase: Phase, urgent: bool) -> None:
    state, orders = step(state_in(phase), OperatorAbort(urgent=urgent), 0.1, mission_of(phase))
    assert (state.phase, orders, state.aborted_by) == (Phase.DONE, (), "operator")


@pytest.mark.parametrize("triggered", [False, True])
@pytest.mark.parametrize("urgent", [False, True])
def test_a_key_while_disarming_leaves_a_landing_what_it_was(urgent: bool, triggered: bool) -> None:
    before = replace(state_in(Phase.DISARMING), triggered=triggered)
    state, orders = step(before, OperatorAbort(urgent=urgent), 0.1, MISSION)
    assert [type(order.command) for order in orders] == [EmergencyStop] * urgent
    assert state.aborted_by == (None if triggered else "operator")


@pytest.mark.parametrize("urgent", [False, True])
def test_a_stop_on_its_way_is_not_ordered_again(urgent: bool) -> None:
    state, orders = step(state_in(Phase.STOPPING), OperatorAbort(urgent=urgent), 0.1, MISSION)
    assert (state, orders) == (replace(state_in(Phase.STOPPING), time=0.1), ())


@pytest.mark.parametrize("phase", [p for p in ALL_PHASES if p is not Phase.STOPPING])
@pytest.mark.parametrize("urgent", [False, True])
def test_the_first_reason_stays_when_the_operator_comes_later(phase: Phase, urgent: bool) -> None:
    before = replace(state_in(phase), aborted_by="pose: LOST")
    state, _ = step(before, OperatorAbort(urgent=urgent), 0.1, mission_of(phase))
    assert state.aborted_by == "pose: LOST"


@pytest.mark.parametrize("phase", [Phase.BRAKING, Phase.LANDING, Phase.DISARMING])
def test_a_first_ctrl_c_on_the_way_down_is_remembered_and_changes_nothing(phase: Phase) -> None:
    state, orders = step(state_in(phase), OperatorAbort(), 0.1, MISSION)
    assert (state.phase, orders, state.aborted_by) == (phase, (), "operator")


@pytest.mark.parametrize("phase", [Phase.FLIPPING, Phase.SETTLING])
def test_a_first_ctrl_c_behind_the_trigger_is_too_late_to_matter(phase: Phase) -> None:
    """The label needs the whole settling: what ends it early costs the landing its name."""
    state, orders = step(state_in(phase), OperatorAbort(), 0.1, MISSION)
    assert (state.phase, orders, state.aborted_by) == (phase, (), None)


# --- failures ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", [Phase.FLIPPING, Phase.SETTLING])
def test_a_command_that_fails_behind_the_trigger_changes_no_phase(phase: Phase) -> None:
    failed = CommandFailed(Order(7, StartApproach()), "no answer")
    state, orders = step(state_in(phase), failed, 0.1, MISSION)
    assert (state.phase, orders) == (phase, ())
    assert state.aborted_by == "StartApproach failed: no answer"


@pytest.mark.parametrize("phase", [Phase.BRAKING, Phase.LANDING, Phase.DISARMING])
def test_the_gentle_way_that_fails_is_a_stop(phase: Phase) -> None:
    state, orders = step(state_in(phase), CommandFailed(Order(7, Land(3.5)), "no answer"), 0.1, MISSION)
    assert [type(order.command) for order in orders] == [EmergencyStop]
    assert (state.phase, state.aborted_by) == (Phase.STOPPING, "Land failed: no answer")


@pytest.mark.parametrize("phase", ALL_PHASES)
def test_a_link_that_breaks_twice_broke_for_the_first_reason(phase: Phase) -> None:
    state, _ = step(replace(state_in(phase), link_lost="silent"), LinkDown("closed"), 0.1, mission_of(phase))
    assert state.link_lost == "silent"


def test_a_link_that_breaks_leaves_a_stop_to_its_own_path() -> None:
    state, orders = step(state_in(Phase.STOPPING), LinkDown("silent"), 0.1, MISSION)
    assert (state.phase, orders, state.aborted_by, state.link_lost) == (Phase.STOPPING, (), None, "silent")


@pytest.mark.parametrize("phase", BEFORE_ARMING)
def test_a_link_that_breaks_before_arming_ends_the_attempt(phase: Phase) -> None:
    state, orders = step(state_in(phase), LinkDown("silent"), 0.1, mission_of(phase))
    assert (state.phase, orders, state.aborted_by) == (Phase.DONE, (), "silent")


@pytest.mark.parametrize("phase", [Phase.FLIPPING, Phase.SETTLING])
def test_a_link_that_breaks_behind_the_trigger_is_no_abort(phase: Phase) -> None:
    state, orders = step(state_in(phase), LinkDown("silent"), 0.1, MISSION)
    assert (state.phase, orders, state.aborted_by) == (Phase.DONE, (), None)


@pytest.mark.parametrize("triggered", [True, False])
def test_a_stop_that_is_not_confirmed_is_told_and_undoes_no_landing(triggered: bool) -> None:
    stopping = replace(state_in(Phase.STOPPING), triggered=triggered)
    state, orders = step(stopping, StopUnconfirmed("silent for 2 s"), 0.1, MISSION)
    assert (state.phase, orders) == (Phase.DONE, ())
    assert state.aborted_by == (None if triggered else "stop_unconfirmed: silent for 2 s")


def test_what_is_done_answers_to_nothing() -> None:
    done = state_in(Phase.DONE)
    for event in (OperatorAbort(urgent=True), LinkDown("silent"), RecordLost("full"), StopUnconfirmed("no")):
        assert step(done, event, PERIOD, MISSION) == (replace(done, time=PERIOD), ())
