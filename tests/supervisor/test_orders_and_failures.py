"""Orders have numbers; answers to old ones count for nothing; failures of our own end the flight gently."""

from dataclasses import replace
from math import nan, radians
from typing import Any

import pytest

from onboard.app_interface import LandingState
from onboard.supervisor_info import SupervisorInfo
from perchhw.supervisor import (
    CommandDone,
    CommandFailed,
    Event,
    FlightState,
    InternalError,
    LinkDown,
    Observation,
    OperatorAbort,
    Order,
    Phase,
    RecordLost,
    StopConfirmed,
    StopUnconfirmed,
    Tick,
    Timing,
    step,
)
from perchhw.supervisor.events import (
    Arm,
    ArmApproach,
    Brake,
    Command,
    Disarm,
    EmergencyStop,
    FlyCourse,
    GoTo,
    HostStoodStill,
    Land,
    StartApproach,
    TakeOff,
)

from .simulated_attempt import MISSION, PERIOD, PLAN, READY, SimulatedAttempt, turned
from .states import ALL_PHASES, BEFORE_ARMING, HOVERING, good_in, mission_of, state_in

WAY_OUT: dict[Phase, tuple[Phase, list[type]]] = {
    Phase.CHECKING: (Phase.DONE, []),
    Phase.UPLOADING: (Phase.DONE, []),
    Phase.READY: (Phase.DONE, []),
    Phase.ARMING: (Phase.DISARMING, [Disarm]),
    **{phase: (Phase.LANDING, [Land]) for phase in HOVERING},
    Phase.APPROACHING: (Phase.BRAKING, [Brake]),
}
"""What a failure of ours makes of each phase; in all others it changes nothing."""


def ordered(orders: tuple[Order, ...]) -> list[type]:
    return [type(order.command) for order in orders]


# --- orders -----------------------------------------------------------------------------------------------


def test_orders_are_numbered_from_one_without_a_gap() -> None:
    for triggers in (True, False):
        attempt = SimulatedAttempt(triggers=triggers)
        attempt.run()
        assert [order.number for order in attempt.orders] == list(range(1, len(attempt.orders) + 1))


@pytest.mark.parametrize(
    ("phase", "command"),
    [
        (Phase.LANDING, GoTo(MISSION.start, 2.0)),
        (Phase.LANDING, ArmApproach()),
        (Phase.LANDING, FlyCourse()),
        (Phase.LANDING, TakeOff(0.6, 2.0)),
        (Phase.BRAKING, StartApproach()),
        (Phase.BRAKING, ArmApproach()),
        (Phase.DISARMING, Arm()),
        (Phase.SETTLING, StartApproach()),
        (Phase.FLIPPING, StartApproach()),
        (Phase.STOPPING, Land(3.5)),
    ],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_a_late_answer_to_an_old_order_changes_nothing(phase: Phase, command: Command) -> None:
    state = state_in(phase)
    for event in (CommandFailed(Order(6, command), "no answer"), CommandDone(Order(6, command))):
        after = step(state, event, 0.1, mission_of(phase))
        assert after.orders == ()
        assert after.state == replace(state, time=0.1)


@pytest.mark.parametrize("phase", [Phase.LANDING, Phase.BRAKING, Phase.DISARMING, Phase.STOPPING])
def test_entering_a_way_out_retires_all_that_was_ordered_before(phase: Phase) -> None:
    entered_from = {
        Phase.LANDING: (Phase.MOVING_TO_START, OperatorAbort()),
        Phase.BRAKING: (Phase.APPROACHING, OperatorAbort()),
        Phase.DISARMING: (Phase.ARMING, OperatorAbort()),
        Phase.STOPPING: (Phase.LANDING, OperatorAbort(urgent=True)),
    }
    before, event = entered_from[phase]
    state, (order,) = step(state_in(before), event, 0.1, MISSION)
    assert state.phase is phase
    assert order.number == 8
    assert state.oldest_in_force == 8


def test_an_answer_to_an_order_that_was_never_given_changes_nothing() -> None:
    for number in (0, 8, 99):
        after = step(state_in(Phase.LANDING), CommandFailed(Order(number, Land(3.5)), "?"), 0.1, MISSION)
        assert (after.state.phase, after.orders) == (Phase.LANDING, ())


def test_a_stop_is_not_judged_by_the_answer_to_its_order() -> None:
    failed = CommandFailed(Order(7, EmergencyStop()), "no route")
    assert step(state_in(Phase.STOPPING), failed, 0.1, MISSION) == (
        replace(state_in(Phase.STOPPING), time=0.1),
        (),
    )


# --- the operator -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", [p for p in ALL_PHASES if p is not Phase.STOPPING])
def test_asked_twice_the_motors_stop_wherever_they_may_turn(phase: Phase) -> None:
    state, _ = step(state_in(phase), OperatorAbort(), 0.1, mission_of(phase))
    if phase in BEFORE_ARMING:
        assert state.phase is Phase.DONE
        return
    assert state.phase is not Phase.DONE
    state, orders = step(state, OperatorAbort(urgent=True), 0.2, mission_of(phase))
    assert ordered(orders) == [EmergencyStop]
    assert state.phase is Phase.STOPPING


def test_a_first_ctrl_c_while_arming_disarms_before_anything_can_lift() -> None:
    state, orders = step(state_in(Phase.ARMING), OperatorAbort(), 0.1, MISSION)
    assert ordered(orders) == [Disarm]
    assert state.phase is Phase.DISARMING


# --- failures of our own ----------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", ALL_PHASES)
def test_a_lost_record_is_latched_told_and_ends_the_flight_where_that_is_safe(phase: Phase) -> None:
    state, orders = step(state_in(phase), RecordLost("No space left on device"), 0.1, mission_of(phase))
    then, commands = WAY_OUT.get(phase, (phase, []))
    assert (state.phase, ordered(orders)) == (then, commands)
    assert state.record_lost == "No space left on device"
    assert ("No space left" in (state.aborted_by or "")) == (phase in WAY_OUT)
    again, _ = step(state, RecordLost("something else"), 0.2, mission_of(phase))
    if state.phase is not Phase.DONE:
        assert again.record_lost == "No space left on device"


@pytest.mark.parametrize("phase", ALL_PHASES)
def test_a_program_that_stood_still_ends_the_flight_where_that_is_safe_and_says_so(phase: Phase) -> None:
    state, orders = step(state_in(phase), HostStoodStill("2 s, need at most 0.3 s"), 0.1, mission_of(phase))
    then, commands = WAY_OUT.get(phase, (phase, []))
    assert (state.phase, ordered(orders)) == (then, commands)
    told = "host_stood_still: 2 s, need at most 0.3 s"
    assert state.aborted_by == (told if phase in WAY_OUT else None)


@pytest.mark.parametrize("phase", ALL_PHASES)
@pytest.mark.parametrize("clock", [None, -5.0, nan], ids=["error", "clock runs back", "clock is no number"])
def test_an_error_of_ours_lands_first_and_is_reported(phase: Phase, clock: float | None) -> None:
    state = replace(state_in(phase), time=0.1)
    if clock is None:
        state, orders = step(state, InternalError("ValueError('no such state')"), 0.12, mission_of(phase))
    else:
        state, orders = step(state, Tick(good_in(phase)), clock, mission_of(phase))
    then, commands = WAY_OUT.get(phase, (phase, []))
    assert (state.phase, ordered(orders)) == (then, commands)
    assert (state.aborted_by or "").startswith("internal_error: ")


@pytest.mark.parametrize("clock", [lambda t: t - 1000.0, lambda t: nan], ids=["set back", "no number"])
def test_deadlines_go_on_when_the_clock_does_not(clock: Any) -> None:
    state, count = replace(state_in(Phase.LANDING), time=0.0), 0
    while state.phase is Phase.LANDING:
        count += 1
        assert count < 1000, "the landing has no end"
        state, orders = step(state, Tick(good_in(Phase.LANDING)), clock(count * PERIOD), MISSION)
    assert ordered(orders) == [EmergencyStop]
    timing = Timing()
    assert count * PERIOD == pytest.approx(timing.land + timing.land_margin, abs=3 * PERIOD)


def test_an_endless_row_of_errors_does_not_drop_a_drone_at_once() -> None:
    """What runs already, goes on; nothing being known for long, it is stopped."""
    state, orders = step(state_in(Phase.LANDING), InternalError("OSError"), 0.02, MISSION)
    assert orders == ()
    state, orders = step(state, Tick(good_in(Phase.LANDING)), 0.04, MISSION)
    assert (state.phase, orders, state.bad_since) == (Phase.LANDING, (), None)
    count = 2
    while state.phase is Phase.LANDING:
        count += 1
        assert count < 1000, "the landing has no end"
        state, orders = step(state, InternalError("OSError"), count * PERIOD, MISSION)
    assert ordered(orders) == [EmergencyStop]
    assert count * PERIOD == pytest.approx(Timing().stop_hold + 3 * PERIOD, abs=2 * PERIOD)


@pytest.mark.parametrize(
    "event",
    [
        CommandFailed(Order(7, Disarm()), "no answer"),
        LinkDown("link_lost: silent"),
        Tick(good_in(Phase.DISARMING)),
    ],
    ids=lambda event: type(event).__name__,
)
@pytest.mark.parametrize("triggered", [True, False])
def test_trouble_with_the_disarming_stops_but_does_not_undo_a_landing(event: Event, triggered: bool) -> None:
    state = replace(state_in(Phase.DISARMING), triggered=triggered)
    state, orders = step(state, event, Timing().disarm_deadline + 0.01, MISSION)
    assert ordered(orders) == [EmergencyStop]
    state, _ = step(state, StopUnconfirmed("silent"), 9.0, MISSION)
    assert state.phase is Phase.DONE
    assert "STOP NOT CONFIRMED" in (state.alert or "")
    assert (state.aborted_by is None) == triggered


# --- what is told to the operator -------------------------------------------------------------------------


def settle(o: Observation, seconds: float, state: FlightState | None = None) -> FlightState:
    """What the machine makes of `seconds` s of the same sight after the motors were cut."""
    state = state or state_in(Phase.SETTLING)
    begin = max(0.0, state.time)
    for count in range(1, round(seconds / PERIOD) + 1):
        state, _ = step(state, Tick(o), begin + count * PERIOD, MISSION)
    return state


def hanging(distance: float, tilt_deg: float) -> dict[str, Any]:
    """Held `distance` m below the ceiling, `tilt_deg` from upside down."""
    place = (0.1, 0.0, PLAN.ceiling_z - distance)
    return {"pose_position": place, "pose_quaternion": turned(tilt=radians(180.0 - tilt_deg))}


@pytest.mark.parametrize(
    ("sight", "alert"),
    [
        (hanging(0.075, 2.0), None),
        (hanging(0.149, 9.9), None),
        (hanging(0.086, 15.0), "HALF ATTACHED"),
        (hanging(0.151, 0.0), "FALL"),
        (hanging(2.03, 0.0), "FALL"),
        ({"pose_age": 0.4}, "NOT SEEN"),
    ],
    ids=["four feet", "at the limits", "two feet", "falling", "on the floor", "unseen"],
)
def test_a_landing_that_does_not_hold_is_told_at_once(sight: dict[str, Any], alert: str | None) -> None:
    o = replace(good_in(Phase.SETTLING), **sight)
    assert settle(o, 0.2).alert is None, "it may still swing into place"
    told = settle(o, 0.4)
    assert told.phase is Phase.SETTLING
    assert told.alert is None if alert is None else alert in (told.alert or "")
    assert told.aborted_by is None
    holding = replace(good_in(Phase.SETTLING), **hanging(0.075, 2.0))
    assert settle(holding, 0.2, told).alert == told.alert, "one look is not enough"
    assert settle(holding, 0.4, told).alert is None


def alerts(sights: list[dict[str, Any]]) -> list[str | None]:
    """What is told while settling, each time that it changes, of one sight a tick."""
    state, told = state_in(Phase.SETTLING), [None]
    for tick, sight in enumerate(sights, start=1):
        o = replace(good_in(Phase.SETTLING), **sight)
        state = step(state, Tick(o), tick * PERIOD, MISSION).state
        if state.alert != told[-1]:
            told.append(state.alert)
    return told[1:]


UNSEEN: dict[str, Any] = {"pose_age": 0.4}


def test_a_fall_is_told_once_however_far_it_goes() -> None:
    (told,) = alerts([hanging(0.2 + 0.01 * tick, 5.0) for tick in range(120)])
    assert "FALLING OR FALLEN: the drone is 0.3" in (told or "")


def test_what_flickers_is_told_once() -> None:
    flickering = [hanging(0.4, 0.0) if tick % 3 else UNSEEN for tick in range(120)]
    assert len(alerts(flickering)) == 1
    held_in_between = [*[hanging(0.4, 0.0)] * 20, *[hanging(0.4, 0.0), hanging(0.075, 2.0)] * 50]
    assert len(alerts(held_in_between)) == 1


def test_what_changes_for_good_is_told_again() -> None:
    told = alerts([*[UNSEEN] * 30, *[hanging(0.09, 30.0)] * 30, *[hanging(0.075, 2.0)] * 30])
    assert [alert and alert.partition(":")[0] for alert in told] == ["NOT SEEN", "HALF ATTACHED", None]


def test_a_drone_that_was_not_triggered_is_not_expected_to_hang() -> None:
    fallen = replace(good_in(Phase.SETTLING), **hanging(2.03, 170.0))
    assert settle(fallen, 0.6, replace(state_in(Phase.SETTLING), triggered=False)).alert is None


def test_what_hangs_by_two_feet_is_told_until_the_end() -> None:
    def half(o: Observation, now: float, state: FlightState) -> Observation:
        return replace(o, **hanging(0.086, 30.0)) if state.phase is Phase.SETTLING else o

    attempt = SimulatedAttempt(fault=half)
    state = attempt.run()
    assert "HALF ATTACHED" in (state.alert or "")
    assert state.aborted_by is None


@pytest.mark.parametrize(
    ("policy", "trajectory", "told"),
    [(False, False, False), (True, False, True), (False, True, True), (None, None, True)],
)
def test_switches_that_are_not_read_back_as_off_are_told(
    policy: bool | None, trajectory: bool | None, told: bool
) -> None:
    what = "STILL ARMED: {} not read back as off; keep away from the drone"
    for phase, words, due in (
        (Phase.LANDING, "approach and policy were", told),
        (Phase.BRAKING, "the policy was", policy is not False),
    ):
        o = replace(good_in(phase), policy_armed=policy, trajectory_armed=trajectory)
        ordered_before = replace(state_in(phase), approach_ordered=True)
        limit = Timing().switches_deadline
        assert step(ordered_before, Tick(o), limit, MISSION).state.alert is None
        after = step(ordered_before, Tick(o), limit + 0.01, MISSION)
        assert after.state.alert == (what.format(words) if due else None)
    assert after.orders == ()
    never = step(state_in(Phase.LANDING), Tick(o), limit + 0.01, MISSION)
    assert never.state.alert is None
    off = replace(o, policy_armed=False, trajectory_armed=False)
    seen_once = step(after.state, Tick(off), limit + 0.03, MISSION).state
    assert seen_once.alert == after.state.alert, "one look is not enough"
    assert step(seen_once, Tick(off), limit + 0.34, MISSION).state.alert is None


def test_motors_that_the_drone_cut_while_landing_are_disarmed() -> None:
    for landing_state in (LandingState.CUT, LandingState.FAULT):
        o = replace(good_in(Phase.LANDING), landing_state=landing_state)
        state, orders = step(state_in(Phase.LANDING), Tick(o), 0.1, MISSION)
        assert (state.phase, ordered(orders)) == (Phase.DISARMING, [Disarm])
    off = replace(good_in(Phase.LANDING), drone=SupervisorInfo(READY))
    assert ordered(step(state_in(Phase.LANDING), Tick(off), 0.1, MISSION).orders) == [Disarm]
    old = replace(off, drone_age=0.3)
    assert step(state_in(Phase.LANDING), Tick(old), 0.1, MISSION).orders == ()


def test_a_stop_on_the_way_leaves_nothing_else_to_do() -> None:
    def endless(o: Observation, now: float, state: FlightState) -> Observation:
        return replace(o, landing_state=LandingState.FLIP) if state.phase is Phase.FLIPPING else o

    attempt = SimulatedAttempt(fault=endless)
    state = attempt.run()
    assert attempt.phases[-2:] == [Phase.STOPPING, Phase.DONE]
    assert isinstance(attempt.commands[-1], EmergencyStop)
    assert step(state, StopConfirmed(), 99.0, MISSION).orders == ()
