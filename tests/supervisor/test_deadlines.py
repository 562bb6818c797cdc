"""No phase waits for ever: each has its deadline, and what comes of it."""

from dataclasses import replace
from math import nextafter

import pytest

from onboard.app_interface import LandingState
from onboard.link.stop import LONGEST_S, SILENT_S
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import (
    CommandDone,
    FlightState,
    InternalError,
    Observation,
    Order,
    Phase,
    Step,
    StopConfirmed,
    StopUnconfirmed,
    Tick,
    Timing,
    step,
)
from perchhw.supervisor.events import Arm, Brake, Command, Disarm, EmergencyStop, Land

from .simulated_attempt import CRC, FLYING, MISSION, PERIOD, PLAN, READY
from .states import good_in, mission_of, state_in

TIMING = Timing()
ACROSS_THE_ROOM = 8.5 / 0.8

DEADLINES: list[tuple[Phase, float, Phase, type[Command] | None, str]] = [
    (Phase.CHECKING, TIMING.checks_deadline, Phase.DONE, None, "drone_can_arm: no"),
    (Phase.UPLOADING, TIMING.upload_deadline, Phase.DONE, None, "policy upload took longer"),
    (Phase.READY, TIMING.ready_deadline, Phase.DONE, None, "too far away"),
    (Phase.ARMING, TIMING.arm_deadline, Phase.DISARMING, Disarm, "did not arm"),
    (Phase.TAKING_OFF, TIMING.take_off + TIMING.move_margin, Phase.LANDING, Land, "no steady hover"),
    (Phase.MOVING_TO_START, ACROSS_THE_ROOM + TIMING.move_margin, Phase.LANDING, Land, "was not reached"),
    (Phase.ARMING_APPROACH, TIMING.approach_arm_deadline, Phase.LANDING, Land, "did not arm the approach"),
    (
        Phase.APPROACHING,
        PLAN.impact_time + TIMING.approach_margin,
        Phase.BRAKING,
        Brake,
        "neither in a trigger nor in a brake",
    ),
    (
        Phase.TEST_FLIGHT,
        MISSION.approach_duration + TIMING.course_margin,
        Phase.LANDING,
        Land,
        "did not come to its end",
    ),
    (Phase.FLIPPING, TIMING.flip_deadline, Phase.STOPPING, EmergencyStop, "flip_time: FLIP"),
    (Phase.LANDING, TIMING.land + TIMING.land_margin, Phase.STOPPING, EmergencyStop, "reach the floor"),
    (Phase.DISARMING, TIMING.disarm_deadline, Phase.STOPPING, EmergencyStop, "did not confirm"),
    (Phase.BRAKING, TIMING.brake_deadline, Phase.LANDING, Land, ""),
    (Phase.SETTLING, TIMING.settle, Phase.DISARMING, Disarm, ""),
    (
        Phase.STOPPING,
        TIMING.stop_deadline,
        Phase.DONE,
        None,
        "stop_unconfirmed: the stop path did not report",
    ),
]


def waiting(phase: Phase) -> Observation:
    """All is well in `phase`, and what it waits for does not come."""
    o = good_in(phase)
    if phase is Phase.CHECKING:
        return replace(o, drone=SupervisorInfo(0))
    if phase is Phase.APPROACHING:
        return replace(o, landing_state=LandingState.TRAJECTORY_ARMED)
    if phase is Phase.TAKING_OFF:
        low = (-3.0, 0.0, 0.2)
        return replace(o, pose_position=low, estimate_position=low)
    return o


@pytest.mark.parametrize(
    ("phase", "deadline", "then", "command", "reason"), DEADLINES, ids=[d[0] for d in DEADLINES]
)
def test_a_phase_that_gets_nowhere_ends_at_its_deadline(
    phase: Phase, deadline: float, then: Phase, command: type[Command] | None, reason: str
) -> None:
    state, now = state_in(phase), 0.0
    mission = replace(MISSION, arm_at=1000.0) if phase is Phase.READY else mission_of(phase)
    orders: tuple[Order, ...] = ()
    while state.phase is phase:
        assert now <= deadline + PERIOD
        now += PERIOD
        state, orders = step(state, Tick(waiting(phase)), now, mission)
    assert now >= deadline - 1e-9, "it ended early"
    assert state.phase is then
    assert [type(o.command) for o in orders] == ([] if command is None else [command])
    assert reason in (state.aborted_by or "")


def test_a_flip_that_nobody_sees_is_stopped_and_judged_by_its_record() -> None:
    o = replace(good_in(Phase.FLIPPING), landing_age=1.0)
    state, orders = step(state_in(Phase.FLIPPING), Tick(o), TIMING.flip_deadline + 0.01, MISSION)
    assert [type(order.command) for order in orders] == [EmergencyStop]
    assert state.aborted_by is None
    assert state.link_lost is not None


@pytest.mark.parametrize(
    ("place", "rule"),
    [((0.0, 1.2, 1.8), "flip_in_room"), ((0.0, 0.0, PLAN.ceiling_z - 0.81), "flip_height")],
)
def test_a_flip_that_leaves_the_ceiling_is_cut(place: tuple[float, float, float], rule: str) -> None:
    state, orders = step(
        state_in(Phase.FLIPPING), Tick(replace(good_in(Phase.FLIPPING), pose_position=place)), 0.1, MISSION
    )
    assert [type(order.command) for order in orders] == [EmergencyStop]
    assert (state.aborted_by or "").startswith(rule)


# --- disarming --------------------------------------------------------------------------------------------

OFF = SupervisorInfo(READY)
ANSWERED = replace(state_in(Phase.DISARMING), answered_at=0.0)


def disarming(state: FlightState, o: Observation, seconds: float) -> Step:
    """Look at the same world for `seconds` s."""
    now, result = 0.0, Step(state)
    while now < seconds and result.state.phase is Phase.DISARMING:
        now += PERIOD
        result = step(result.state, Tick(o), now, MISSION)
    return result


def test_disarming_ends_when_new_bits_have_said_so_for_a_while() -> None:
    o = replace(good_in(Phase.DISARMING), drone=OFF)
    least = TIMING.bits_delay + TIMING.disarm_hold
    assert disarming(ANSWERED, o, least - 2 * PERIOD).state.phase is Phase.DISARMING
    assert disarming(ANSWERED, o, least + 3 * PERIOD) == (disarming(ANSWERED, o, 9.0).state, ())
    assert disarming(ANSWERED, o, 9.0).state.phase is Phase.DONE


@pytest.mark.parametrize(
    "changes",
    [
        {"drone_age": 0.26},
        {"drone_age": None},
        {"drone": None},
        {"drone": SupervisorInfo(FLYING)},
        {"drone": SupervisorInfo(FLYING & ~SupervisorBits.FLYING)},
    ],
    ids=str,
)
def test_disarming_does_not_end_by_old_bits_or_by_armed_ones(changes: dict[str, object]) -> None:
    o = replace(good_in(Phase.DISARMING), drone=OFF)
    after = disarming(ANSWERED, replace(o, **changes), 9.0)  # type: ignore[arg-type]
    assert [type(order.command) for order in after.orders] == [EmergencyStop]


def test_a_disarm_that_is_not_answered_proves_nothing() -> None:
    """The bits say "not armed", but the order to arm may still be on its way."""
    o = replace(good_in(Phase.DISARMING), drone=OFF)
    assert disarming(state_in(Phase.DISARMING), o, 1.0).state.phase is Phase.DISARMING
    after = disarming(state_in(Phase.DISARMING), o, 9.0)
    assert [type(order.command) for order in after.orders] == [EmergencyStop]


def test_an_arming_that_comes_late_is_seen() -> None:
    off, on = replace(good_in(Phase.DISARMING), drone=OFF), good_in(Phase.DISARMING)
    state = ANSWERED
    for count in range(1, 100):
        o = on if count in (10, 11) else off
        state, _ = step(state, Tick(o), count * PERIOD, MISSION)
        if state.phase is Phase.DONE:
            break
    assert count * PERIOD >= 12 * PERIOD + TIMING.disarm_hold


# --- stopping ---------------------------------------------------------------------------------------------


def test_a_stop_ends_only_when_its_own_path_says_so() -> None:
    state = state_in(Phase.STOPPING)
    locked = replace(good_in(Phase.STOPPING), drone=SupervisorInfo(SupervisorBits.LOCKED))
    answered = CommandDone(Order(7, EmergencyStop()))
    for count, event in enumerate((Tick(locked), Tick(Observation()), answered) * 25):
        state, orders = step(state, event, count * 0.1, MISSION)
        assert (state.phase, orders) == (Phase.STOPPING, ())
    assert step(state, StopConfirmed(), 7.9, MISSION).state.phase is Phase.DONE
    unconfirmed = step(state, StopUnconfirmed("silent for 2 s"), 7.9, MISSION)
    assert unconfirmed.state.phase is Phase.DONE
    assert "silent for 2 s" in (unconfirmed.state.alert or "")
    assert unconfirmed.state.stop_unconfirmed == "silent for 2 s"
    assert "silent for 2 s" in (unconfirmed.state.aborted_by or "")


def test_a_stop_of_which_nobody_reports_ends_loudly() -> None:
    """Its thread is gone: nobody knows whether a copy has left, and no order follows."""
    locked = Tick(replace(good_in(Phase.STOPPING), drone=SupervisorInfo(SupervisorBits.LOCKED)))
    assert TIMING.stop_deadline == SILENT_S + LONGEST_S, "longer than the stop path takes for any report"
    for event in (Tick(Observation()), locked, InternalError("the clock reads nan")):
        in_time = step(state_in(Phase.STOPPING), event, TIMING.stop_deadline, MISSION)
        assert (in_time.state.phase, in_time.orders) == (Phase.STOPPING, ())
        late = step(in_time.state, event, nextafter(TIMING.stop_deadline, 9.0), MISSION)
        assert (late.state.phase, late.orders) == (Phase.DONE, ())
        why = "the stop path did not report within 8 s"
        assert late.state.stop_unconfirmed == why
        assert (
            late.state.alert == f"STOP NOT CONFIRMED ({why}): the motors may turn; keep away from the drone"
        )


@pytest.mark.parametrize("phase", [p for p in Phase if p not in (Phase.STOPPING, Phase.DONE)])
def test_a_stop_that_was_not_ordered_confirms_nothing(phase: Phase) -> None:
    for event in (StopConfirmed(), StopUnconfirmed("no")):
        after = step(state_in(phase), event, 0.01, mission_of(phase))
        assert after.state.phase is phase
        assert after.orders == ()


def test_a_good_crc_is_demanded_again_before_take_off_and_before_the_approach() -> None:
    arming = replace(state_in(Phase.ARMING), good_since=-1.0)
    o = replace(good_in(Phase.ARMING), drone=SupervisorInfo(FLYING))
    assert step(arming, Tick(o), 0.01, MISSION).state.phase is Phase.TAKING_OFF
    for changes in ({"policy_crc_age": 0.26}, {"active_policy_crc": CRC ^ 1}):
        after = step(arming, Tick(replace(o, **changes)), 0.01, MISSION)  # type: ignore[arg-type]
        assert "policy_crc" in (after.state.aborted_by or "")
        assert [type(order.command) for order in after.orders] == [Disarm]


def test_the_motors_are_armed_when_the_time_has_come_and_not_before() -> None:
    state, mission = state_in(Phase.READY), mission_of(Phase.READY)
    early = step(state, Tick(good_in(Phase.READY)), mission.arm_at - 1e-6, mission)
    assert (early.state.phase, early.orders) == (Phase.READY, ())
    in_time = step(early.state, Tick(good_in(Phase.READY)), mission.arm_at, mission)
    assert in_time.state.phase is Phase.ARMING
    assert [type(order.command) for order in in_time.orders] == [Arm]


def test_a_time_to_arm_that_is_too_far_away_is_not_waited_for() -> None:
    never = replace(MISSION, arm_at=1000.0)
    state = step(state_in(Phase.READY), Tick(good_in(Phase.READY)), TIMING.ready_deadline, never).state
    assert state.phase is Phase.READY
    late = TIMING.ready_deadline + PERIOD
    state = step(state, Tick(good_in(Phase.READY)), late, never).state
    assert state.phase is Phase.DONE
    assert "too far away" in str(state.aborted_by)
