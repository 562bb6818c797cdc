"""From take-off to the start of the approach: what moves a phase on, inside and outside of its limits."""

from dataclasses import replace
from math import nextafter
from typing import Any

import pytest

from onboard.app_interface import LandingState
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import CommandDone, FlightState, Mission, Order, Phase, Tick, Timing, step
from perchhw.supervisor.events import (
    Arm,
    ArmApproach,
    Command,
    Disarm,
    FlyCourse,
    GoTo,
    Land,
    StartApproach,
    TakeOff,
    UploadPolicy,
)

from .simulated_attempt import CRC, FLYING, MISSION, PERIOD, TEST_FLIGHT
from .states import good_in, mission_of, state_in

TIMING = Timing()
X, Y, Z = MISSION.start


def look(
    state: FlightState, now: float = PERIOD, mission: Mission | None = None, **changes: Any
) -> tuple[FlightState, list[Command]]:
    """The state after one look, well but for `changes`, and what was ordered."""
    o = replace(good_in(state.phase), **changes)
    after, orders = step(state, Tick(o), now, mission or mission_of(state.phase))
    return after, [order.command for order in orders]


def at(x: float, y: float, z: float) -> dict[str, Any]:
    return {"pose_position": (x, y, z), "estimate_position": (x, y, z)}


# --- arming -----------------------------------------------------------------------------------------------


def test_a_drone_that_may_fly_takes_off_after_its_hold() -> None:
    flying: dict[str, Any] = {"drone": SupervisorInfo(FLYING)}
    state, ordered = look(state_in(Phase.ARMING), **flying)
    assert (state.phase, ordered, state.good_since) == (Phase.ARMING, [], PERIOD)
    waits = replace(state_in(Phase.ARMING), good_since=0.0)
    assert look(waits, nextafter(TIMING.arm_hold, 0.0), **flying)[1] == []
    state, ordered = look(waits, TIMING.arm_hold, **flying)
    assert ordered == [TakeOff(MISSION.hover_height, TIMING.take_off)]
    assert (state.phase, state.waiting_for) == (Phase.TAKING_OFF, "the first hover")
    assert (state.armed, state.airborne_since) == (True, TIMING.arm_hold)


# --- taking off -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("height", "since", "counts"),
    [
        (0.501, TIMING.take_off, True),
        (0.699, TIMING.take_off, True),
        (0.499, TIMING.take_off, False),
        (0.701, TIMING.take_off, False),
        (0.6, nextafter(TIMING.take_off, 0.0), False),
        (0.6, TIMING.take_off + 1.0, True),
    ],
)
def test_a_first_hover_counts_at_its_height_once_the_climb_is_over(
    height: float, since: float, counts: bool
) -> None:
    state, ordered = look(state_in(Phase.TAKING_OFF), since, **at(-3.0, 0.0, height))
    assert (state.phase, ordered) == (Phase.TAKING_OFF, [])
    assert (state.good_since is not None) == counts


@pytest.mark.parametrize(
    ("x", "speed", "duration"), [(X, 0.8, 2.0), (X + 1.6, 0.8, 2.0), (X + 2.4, 0.8, 3.0), (X + 2.4, 0.6, 4.0)]
)
def test_the_drone_moves_to_the_start_with_the_speed_of_the_mission(
    x: float, speed: float, duration: float
) -> None:
    steady = replace(state_in(Phase.TAKING_OFF), good_since=TIMING.take_off)
    mission = replace(MISSION, transit_speed=speed, hover_height=Z)
    now = TIMING.take_off + TIMING.hover_hold + 1e-9
    state, (command,) = look(steady, now, mission, **at(x, Y, Z))
    assert isinstance(command, GoTo)
    assert command.position == MISSION.start
    assert command.duration == pytest.approx(duration)
    assert (state.phase, state.waiting_for) == (Phase.MOVING_TO_START, "the start of the approach")


# --- moving to the start ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("place", "velocity", "settled"),
    [
        ((X + 0.079, Y, Z), (0.0, 0.0, 0.0), True),
        ((X, Y - 0.079, Z), (0.0, 0.149, 0.0), True),
        ((X, Y, Z + 0.081), (0.0, 0.0, 0.0), False),
        ((X, Y + 0.06, Z + 0.06), (0.0, 0.0, 0.0), False),
        ((X, Y, Z), (0.0, 0.0, -0.151), False),
        ((X, Y, Z), (0.11, 0.11, 0.0), False),
        ((X + 0.081, Y, Z), (0.151, 0.0, 0.0), False),
    ],
)
@pytest.mark.parametrize("test_flight", [False, True])
def test_the_drone_has_settled_when_it_is_near_and_slow(
    place: tuple[float, float, float],
    velocity: tuple[float, float, float],
    settled: bool,
    test_flight: bool,
) -> None:
    mission = TEST_FLIGHT if test_flight else MISSION
    waits = replace(state_in(Phase.MOVING_TO_START), good_since=0.0)
    sight = {**at(*place), "estimate_velocity": velocity}
    early, ordered = look(waits, nextafter(TIMING.hover_hold, 0.0), mission, **sight)
    assert (early.phase, ordered) == (Phase.MOVING_TO_START, [])
    assert (early.good_since is not None) == settled
    state, ordered = look(waits, TIMING.hover_hold, mission, **sight)
    if not settled:
        assert (state.phase, ordered) == (Phase.MOVING_TO_START, [])
    elif test_flight:
        assert (state.phase, ordered, state.waiting_for) == (
            Phase.TEST_FLIGHT,
            [FlyCourse()],
            "the end of the course",
        )
        assert not state.approach_ordered
    else:
        assert (state.phase, ordered) == (Phase.ARMING_APPROACH, [ArmApproach()])
        assert state.waiting_for == "the drone to accept the approach"
        assert state.approach_ordered


# --- arming the approach ----------------------------------------------------------------------------------

ARMED = replace(state_in(Phase.ARMING_APPROACH), answered_at=0.0)
READ_BACK: dict[str, Any] = {
    "landing_state": LandingState.TRAJECTORY_ARMED,
    "policy_armed": True,
    "trajectory_armed": True,
}


def test_the_approach_starts_and_remembers_how_often_the_drone_has_triggered() -> None:
    for count in (0, 3):
        state, ordered = look(ARMED, **READ_BACK, trigger_count=count)
        assert (state.phase, ordered) == (Phase.APPROACHING, [StartApproach()])
        assert (state.triggers_before, state.waiting_for) == (count, "the trigger")


@pytest.mark.parametrize(
    ("state", "changes", "missing"),
    [
        (replace(ARMED, answered_at=None), {}, "the order to arm it has not been answered"),
        (ARMED, {"landing_state": LandingState.IDLE}, "its landing state is IDLE"),
        (ARMED, {"landing_state": None}, "its landing state is unknown"),
        (ARMED, {"trajectory_armed": False}, "the switch of the trajectory was read back as off"),
        (ARMED, {"trajectory_armed": None}, "the switch of the trajectory was not read back"),
        (ARMED, {"policy_armed": False}, "the switch of the policy was read back as off"),
        (ARMED, {"policy_armed": None}, "the switch of the policy was not read back"),
        (ARMED, {"trigger_count": None}, "its count of triggers is unknown"),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_an_approach_that_is_not_armed_says_what_is_missing(
    state: FlightState, changes: dict[str, Any], missing: str
) -> None:
    sight = {**READ_BACK, **changes}
    waits, ordered = look(state, TIMING.approach_arm_deadline, **sight)
    assert (waits.phase, ordered) == (Phase.ARMING_APPROACH, [])
    late, ordered = look(state, nextafter(TIMING.approach_arm_deadline, 9.0), **sight)
    assert ordered == [Land(TIMING.land)]
    assert late.aborted_by == f"the drone did not arm the approach: {missing}"


# --- deadlines and answers --------------------------------------------------------------------------------

LONGEST: list[tuple[Phase, float, type[Command] | None, dict[str, Any]]] = [
    (Phase.CHECKING, TIMING.checks_deadline, None, {"parameters_ok": False}),
    (Phase.UPLOADING, TIMING.upload_deadline, None, {}),
    (Phase.ARMING, TIMING.arm_deadline, Disarm, {}),
    (Phase.TAKING_OFF, TIMING.take_off + TIMING.move_margin, Land, at(-3.0, 0.0, 0.3)),
    (Phase.MOVING_TO_START, 8.5 / 0.8 + TIMING.move_margin, Land, at(-1.0, 0.0, 1.0)),
    (Phase.TEST_FLIGHT, TEST_FLIGHT.approach_duration + TIMING.course_margin, Land, {}),
]


@pytest.mark.parametrize(("phase", "deadline", "command", "sight"), LONGEST, ids=[row[0] for row in LONGEST])
def test_a_phase_has_its_time_to_the_end_and_no_more(
    phase: Phase, deadline: float, command: type[Command] | None, sight: dict[str, Any]
) -> None:
    state, ordered = look(state_in(phase), deadline, **sight)
    assert (state.phase, ordered, state.aborted_by) == (phase, [], None)
    late, ordered = look(state_in(phase), nextafter(deadline, 99.0), **sight)
    assert [type(one) for one in ordered] == ([] if command is None else [command])
    assert late.aborted_by is not None


def test_a_course_that_was_flown_is_landed_once() -> None:
    done = CommandDone(Order(7, FlyCourse()))
    state, (order,) = step(state_in(Phase.TEST_FLIGHT), done, 1.0, TEST_FLIGHT)
    assert (state.phase, order.command, state.aborted_by) == (Phase.LANDING, Land(TIMING.land), None)
    for phase in (Phase.LANDING, Phase.BRAKING, Phase.DISARMING):
        state, orders = step(state_in(phase), done, 1.0, TEST_FLIGHT)
        assert (state.phase, orders) == (phase, ())


def test_an_answer_is_remembered_with_its_time() -> None:
    state, orders = step(state_in(Phase.ARMING_APPROACH), CommandDone(Order(7, ArmApproach())), 0.3, MISSION)
    assert (state.phase, orders, state.answered_at) == (Phase.ARMING_APPROACH, (), 0.3)


def test_an_upload_is_answered_once() -> None:
    for phase in (Phase.READY, Phase.ARMING, Phase.TAKING_OFF):
        done = CommandDone(Order(7, UploadPolicy()), CRC ^ 1)
        state, orders = step(state_in(phase), done, 0.1, mission_of(phase))
        assert (state.phase, orders, state.aborted_by) == (phase, (), None)


def test_at_the_very_edge_nothing_counts() -> None:
    """The errors of a hover are exclusive."""
    mission = replace(MISSION, start=(0.0, 0.0, 1.0), hover_height=0.0)
    moving = state_in(Phase.MOVING_TO_START)
    for sight in (at(0.08, 0.0, 1.0), {**at(0.0, 0.0, 1.0), "estimate_velocity": (0.15, 0.0, 0.0)}):
        assert look(moving, PERIOD, mission, **sight)[0].good_since is None
    assert look(moving, PERIOD, mission, **at(0.0799, 0.0, 1.0))[0].good_since is not None
    for height, counts in ((0.1, False), (0.0999, True)):
        state, _ = look(state_in(Phase.TAKING_OFF), 3.0, mission, **at(-1.0, 0.0, height))
        assert (state.good_since is not None) == counts


# --- the policy -------------------------------------------------------------------------------------------

MAY_FLY = {"drone": SupervisorInfo(FLYING)}
HELD = replace(state_in(Phase.ARMING), good_since=-1.0)


@pytest.mark.parametrize(
    ("crc", "reason"),
    [
        (CRC, None),
        (0x0234ABCD, "policy_crc: the drone has 0234abcd, need 1234abcd"),
        (None, "policy_crc: the drone has unknown, need 1234abcd"),
    ],
)
def test_what_is_live_after_the_upload_is_what_was_uploaded(crc: int | None, reason: str | None) -> None:
    done = CommandDone(Order(7, UploadPolicy()), crc)
    state, orders = step(state_in(Phase.UPLOADING), done, 0.1, MISSION)
    assert (state.phase, state.aborted_by) == (Phase.ARMING if reason is None else Phase.DONE, reason)
    assert [order.command for order in orders] == ([Arm()] if reason is None else [])
    sight: dict[str, Any] = {**MAY_FLY, "active_policy_crc": crc}
    state, ordered = look(HELD, PERIOD, **sight)
    assert state.aborted_by == reason
    assert ordered == ([TakeOff(MISSION.hover_height, TIMING.take_off)] if reason is None else [Disarm()])


def test_what_was_live_long_ago_proves_nothing() -> None:
    sight: dict[str, Any] = {**MAY_FLY, "policy_crc_age": 0.251}
    assert look(HELD, PERIOD, **sight)[0].aborted_by == "policy_crc_age: 0.251 s, need at most 0.25 s"


def test_a_test_flight_asks_for_no_policy() -> None:
    sight: dict[str, Any] = {**MAY_FLY, "active_policy_crc": 5, "policy_crc_age": None}
    assert look(HELD, PERIOD, TEST_FLIGHT, **sight)[0].phase is Phase.TAKING_OFF


@pytest.mark.parametrize("bits", [SupervisorBits.ARMED, SupervisorBits.CAN_FLY, SupervisorBits.CAN_ARM])
def test_only_what_is_armed_and_may_fly_takes_off(bits: SupervisorBits) -> None:
    state, ordered = look(HELD, PERIOD, drone=SupervisorInfo(bits))
    assert (state.phase, ordered, state.good_since) == (Phase.ARMING, [], None)
