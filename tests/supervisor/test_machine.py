"""The supervisor's state machine: the whole flight, and every way out of it."""

from dataclasses import replace

import pytest

from mocap_bridge.health import PoseVerdict
from onboard.app_interface import EndReason, LandingState
from onboard.supervisor_info import SupervisorInfo
from perchhw.supervisor import (
    CommandDone,
    CommandFailed,
    FlightState,
    LinkDown,
    Observation,
    OperatorAbort,
    Order,
    Phase,
    StopUnconfirmed,
    Tick,
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
    Land,
    StartApproach,
    TakeOff,
    UploadPolicy,
)

from .simulated_attempt import CRC, FLYING, MISSION, TEST_FLIGHT, SimulatedAttempt, good_on_ground, turned

MOTION = (Arm, TakeOff, GoTo, ArmApproach, StartApproach, FlyCourse)


ON_GROUND = (Phase.CHECKING, Phase.UPLOADING, Phase.READY)
AFTER_TRIGGER = (Phase.FLIPPING, Phase.SETTLING)
MOTORS_MAY_TURN = tuple(p for p in Phase if p not in (*ON_GROUND, *AFTER_TRIGGER, Phase.STOPPING, Phase.DONE))


def in_the_air(phase: Phase) -> FlightState:
    """A state in `phase` since 0 s whose order is number 7."""
    return FlightState(
        phase=phase, entered_at=0.0, armed=True, arm_ordered=True, orders_given=7, oldest_in_force=7
    )


def kinds(attempt: SimulatedAttempt) -> list[type]:
    return [type(command) for command in attempt.commands]


def test_a_good_attempt_goes_through_every_phase_in_order() -> None:
    attempt = SimulatedAttempt()
    state = attempt.run()
    assert kinds(attempt) == [UploadPolicy, Arm, TakeOff, GoTo, ArmApproach, StartApproach, Disarm]
    assert attempt.phases == [
        Phase.CHECKING,
        Phase.UPLOADING,
        Phase.ARMING,
        Phase.TAKING_OFF,
        Phase.MOVING_TO_START,
        Phase.ARMING_APPROACH,
        Phase.APPROACHING,
        Phase.FLIPPING,
        Phase.SETTLING,
        Phase.DISARMING,
        Phase.DONE,
    ]
    assert state.triggered
    assert state.aborted_by is None


def test_a_dry_run_uploads_and_never_arms() -> None:
    attempt = SimulatedAttempt(mission=replace(MISSION, dry_run=True))
    state = attempt.run()
    assert kinds(attempt) == [UploadPolicy]
    assert state.aborted_by is None
    assert not state.armed


def test_a_missed_trigger_lands_on_the_floor() -> None:
    attempt = SimulatedAttempt(triggers=False)
    state = attempt.run()
    assert kinds(attempt)[-2:] == [Land, Disarm]
    assert not state.triggered
    assert state.aborted_by is None


@pytest.mark.parametrize("reason", [EndReason.BAD_ESTIMATE, EndReason.OFF_TRACK, None])
def test_an_approach_that_the_drone_broke_off_is_an_abort_that_names_the_reason(
    reason: EndReason | None,
) -> None:
    attempt = SimulatedAttempt(triggers=False, ends_by=reason)
    state = attempt.run()
    assert kinds(attempt)[-2:] == [Land, Disarm]
    assert (reason.name.lower() if reason else "unknown") in (state.aborted_by or "")


@pytest.mark.parametrize(("count", "triggered"), [(1, True), (0, False), (None, False)])
def test_motors_that_stop_on_the_approach_are_a_trigger_only_if_the_drone_counted_one(
    count: int | None, triggered: bool
) -> None:
    def touch(o: Observation, now: float, state: FlightState) -> Observation:
        if state.phase is not Phase.APPROACHING:
            return o
        return replace(o, landing_state=LandingState.CUT, trigger_count=count)

    attempt = SimulatedAttempt(fault=touch)
    assert attempt.run().triggered is triggered
    assert kinds(attempt)[-1] is Disarm


def test_a_landing_state_that_is_old_ends_the_approach_and_triggers_nothing() -> None:
    def frozen(o: Observation, now: float, state: FlightState) -> Observation:
        if state.phase is not Phase.APPROACHING:
            return o
        return replace(o, landing_state=LandingState.CUT, landing_age=1.0)

    attempt = SimulatedAttempt(fault=frozen)
    state = attempt.run()
    assert not state.triggered
    assert state.aborted_by == "landing_age: 1 s, need at most 0.25 s"
    assert kinds(attempt)[-3:] == [Brake, Land, Disarm]


def test_a_fault_while_braking_is_not_landed_but_disarmed() -> None:
    def faulty(o: Observation, now: float, state: FlightState) -> Observation:
        return replace(o, landing_state=LandingState.FAULT) if state.phase is Phase.BRAKING else o

    attempt = SimulatedAttempt(fault=faulty, triggers=False)
    attempt.run()
    assert Land not in kinds(attempt)
    assert kinds(attempt)[-1] is Disarm


def test_a_wrong_policy_on_the_drone_never_arms() -> None:
    state = FlightState(phase=Phase.UPLOADING, entered_at=0.0, orders_given=1)
    for crc in (None, 0, CRC ^ 1):
        done, orders = step(state, CommandDone(Order(1, UploadPolicy()), crc), 1.0, MISSION)
        assert done.phase is Phase.DONE
        assert orders == ()
        assert "policy_crc" in (done.aborted_by or "")


def test_a_policy_that_changes_after_the_upload_is_noticed_before_take_off() -> None:
    def other_policy(o: Observation, now: float, state: FlightState) -> Observation:
        return replace(o, active_policy_crc=7) if state.phase is Phase.ARMING else o

    attempt = SimulatedAttempt(fault=other_policy)
    state = attempt.run()
    assert TakeOff not in kinds(attempt)
    assert kinds(attempt)[-1] is Disarm
    assert "policy_crc" in (state.aborted_by or "")


AIRBORNE = [Phase.TAKING_OFF, Phase.MOVING_TO_START, Phase.ARMING_APPROACH]


@pytest.mark.parametrize("phase", AIRBORNE)
@pytest.mark.parametrize(
    "fault",
    [
        {"pose_verdict": PoseVerdict.LOST},
        {"pose_age": 0.4},
        {"link_silence": 0.7},
        {"estimate_age": 0.5},
        {"battery_voltage": 2.5},
        {"drone": None},
        {"estimate_position": (0.0, 0.0, 1.0)},
    ],
    ids=lambda fault: next(iter(fault)),
)
def test_a_fault_in_a_hover_lands(phase: Phase, fault: dict[str, object]) -> None:
    def broken(o: Observation, now: float, state: FlightState) -> Observation:
        return replace(o, **fault) if state.phase is phase else o  # type: ignore[arg-type]

    attempt = SimulatedAttempt(fault=broken)
    state = attempt.run()
    assert kinds(attempt)[-2:] == [Land, Disarm]
    assert state.aborted_by is not None
    assert StartApproach not in kinds(attempt)


def test_a_test_flight_needs_no_policy_and_lands_when_its_course_is_flown() -> None:
    attempt = SimulatedAttempt(mission=TEST_FLIGHT)
    state = attempt.run()
    assert kinds(attempt) == [Arm, TakeOff, GoTo, FlyCourse, Land, Disarm]
    assert state.aborted_by is None


@pytest.mark.parametrize(
    "fault",
    [
        {"pose_verdict": PoseVerdict.LOST},
        {"pose_position": (0.0, 3.0, 1.0), "estimate_position": (0.0, 3.0, 1.0)},
        {"battery_voltage": 2.5},
        {"estimate_quaternion": turned(tilt=1.3)},
        {"link_silence": 2.0},
    ],
    ids=lambda fault: next(iter(fault)),
)
def test_a_fault_during_a_test_flight_lands_at_once(fault: dict[str, object]) -> None:
    def broken(o: Observation, now: float, state: FlightState) -> Observation:
        return replace(o, **fault) if state.phase is Phase.TEST_FLIGHT else o  # type: ignore[arg-type]

    attempt = SimulatedAttempt(mission=TEST_FLIGHT, fault=broken)
    state = attempt.run()
    assert kinds(attempt)[-3:] == [FlyCourse, Land, Disarm]
    assert state.aborted_by is not None


def test_a_course_that_does_not_end_is_landed() -> None:
    attempt = SimulatedAttempt(mission=TEST_FLIGHT)
    state = FlightState(phase=Phase.TEST_FLIGHT, entered_at=0.0, armed=True)
    flying = replace(
        good_on_ground(), drone=SupervisorInfo(FLYING), pose_position=(-3.0, 0.0, 1.0),
        estimate_position=(-3.0, 0.0, 1.0),
    )  # fmt: skip
    later = attempt.mission.approach_duration + 3.0
    after, orders = step(state, Tick(flying), later, attempt.mission)
    assert [type(o.command) for o in orders] == [Land]
    assert "did not come to its end" in (after.aborted_by or "")


def test_a_fault_on_the_approach_brakes_on_the_drone_and_lands() -> None:
    def lost(o: Observation, now: float, state: FlightState) -> Observation:
        return replace(o, pose_verdict=PoseVerdict.LOST) if state.phase is Phase.APPROACHING else o

    attempt = SimulatedAttempt(fault=lost)
    state = attempt.run()
    assert kinds(attempt)[-3:] == [Brake, Land, Disarm]
    assert "LOST" in (state.aborted_by or "")


def test_a_pose_lost_during_the_flip_does_not_abort_the_landing() -> None:
    def lost(o: Observation, now: float, state: FlightState) -> Observation:
        flipping = state.phase in (Phase.FLIPPING, Phase.SETTLING)
        return replace(o, pose_verdict=PoseVerdict.LOST, pose_age=1.0) if flipping else o

    attempt = SimulatedAttempt(fault=lost)
    assert attempt.run().aborted_by is None
    assert kinds(attempt)[-1] is Disarm


def test_a_flip_that_never_ends_is_cut() -> None:
    def endless(o: Observation, now: float, state: FlightState) -> Observation:
        return replace(o, landing_state=LandingState.FLIP) if state.phase is Phase.FLIPPING else o

    attempt = SimulatedAttempt(fault=endless)
    attempt.run()
    assert EmergencyStop in kinds(attempt)


@pytest.mark.parametrize("phase", [p for p in Phase if p not in (Phase.DONE, Phase.STOPPING)])
def test_the_operator_ends_any_phase(phase: Phase) -> None:
    attempt = SimulatedAttempt(events_at={phase: OperatorAbort()}, triggers=phase is not Phase.BRAKING)
    if phase is Phase.TEST_FLIGHT:
        attempt.mission = TEST_FLIGHT
    if phase is Phase.READY:
        attempt.mission = replace(MISSION, arm_at=3.0)
    if phase is Phase.LANDING:
        attempt.triggers = False
    state = attempt.run()
    assert phase in attempt.phases
    if Arm in kinds(attempt):
        assert kinds(attempt)[-1] in (Disarm, EmergencyStop)
    landed_first = (Phase.FLIPPING, Phase.SETTLING, Phase.DISARMING)
    assert (state.aborted_by == "operator") == (phase not in landed_first)


@pytest.mark.parametrize("phase", [Phase.TAKING_OFF, Phase.APPROACHING, Phase.FLIPPING, Phase.LANDING])
def test_the_operator_cuts_the_motors_when_asked_twice(phase: Phase) -> None:
    stopping, orders = step(in_the_air(phase), OperatorAbort(urgent=True), 0.1, MISSION)
    assert [o.command for o in orders] == [EmergencyStop()]
    assert stopping.phase is Phase.STOPPING


@pytest.mark.parametrize("phase", ON_GROUND)
def test_a_lost_link_on_the_ground_ends_the_attempt_at_once(phase: Phase) -> None:
    done, orders = step(FlightState(phase=phase, entered_at=0.0), LinkDown("link_lost: silent"), 0.1, MISSION)
    assert done.phase is Phase.DONE
    assert done.aborted_by == "link_lost: silent"
    assert orders == ()


@pytest.mark.parametrize("phase", MOTORS_MAY_TURN)
def test_a_lost_link_with_motors_that_may_turn_is_a_stop_that_takes_its_own_path(phase: Phase) -> None:
    stopping, orders = step(in_the_air(phase), LinkDown("link_lost: silent"), 0.1, MISSION)
    assert [o.command for o in orders] == [EmergencyStop()]
    assert stopping.aborted_by == "link_lost: silent"
    done, orders = step(stopping, StopUnconfirmed("no answer"), 0.6, MISSION)
    assert (done.phase, orders) == (Phase.DONE, ())
    assert done.aborted_by == "link_lost: silent"
    assert "no answer" in (done.alert or "")


@pytest.mark.parametrize("phase", [Phase.FLIPPING, Phase.SETTLING])
def test_a_link_lost_after_the_trigger_is_no_abort(phase: Phase) -> None:
    done, orders = step(in_the_air(phase), LinkDown("link_lost: silent"), 0.1, MISSION)
    assert (done.phase, orders, done.aborted_by) == (Phase.DONE, (), None)
    assert done.link_lost == "link_lost: silent"


@pytest.mark.parametrize(
    ("phase", "command", "answer"),
    [
        (Phase.UPLOADING, UploadPolicy(), []),
        (Phase.ARMING, Arm(), [Disarm]),
        (Phase.TAKING_OFF, TakeOff(0.6, 2.0), [Land]),
        (Phase.ARMING_APPROACH, ArmApproach(), [Land]),
        (Phase.APPROACHING, StartApproach(), [Brake]),
        (Phase.BRAKING, Brake(), [EmergencyStop]),
        (Phase.LANDING, Land(2.0), [EmergencyStop]),
        (Phase.DISARMING, Disarm(), [EmergencyStop]),
    ],
    ids=lambda value: str(value) if isinstance(value, Phase) else "",
)
def test_a_failed_command_is_an_abort(phase: Phase, command: Command, answer: list[type]) -> None:
    state = replace(in_the_air(phase), arm_ordered=phase is not Phase.UPLOADING)
    after, orders = step(state, CommandFailed(Order(state.orders_given, command), "no answer"), 0.1, MISSION)
    assert [type(o.command) for o in orders] == answer
    assert "no answer" in (after.aborted_by or "")


@pytest.mark.parametrize(
    ("also", "more"), [({}, ""), ({"parameters_ok": False}, " (and 1 more)")], ids=["one", "two"]
)
def test_checks_that_do_not_pass_are_counted_in_what_they_wait_for(also: dict[str, bool], more: str) -> None:
    waits = set()

    def flat(o: Observation, now: float, state: FlightState) -> Observation:
        waits.add(state.waiting_for)
        return replace(o, battery_voltage=3.5, **also)

    SimulatedAttempt(fault=flat).run()
    assert f"battery_at_rest: 3.5 V, need at least 3.8 V{more}" in waits


def test_checks_that_never_pass_end_with_every_rule_that_failed() -> None:
    waits = set()

    def flat(o: Observation, now: float, state: FlightState) -> Observation:
        waits.add(state.waiting_for)
        return replace(o, battery_voltage=3.5, parameters_ok=False, pose_verdict=PoseVerdict.STALE)

    attempt = SimulatedAttempt(fault=flat)
    state = attempt.run()
    assert attempt.commands == []
    named = [sentence.partition(":")[0] for sentence in (state.aborted_by or "").split("; ")]
    assert named == ["battery_at_rest", "parameters", "pose"]
    assert "battery_at_rest: 3.5 V, need at least 3.8 V (and 2 more)" in waits


def test_checks_must_hold_without_a_break() -> None:
    def flicker(o: Observation, now: float, state: FlightState) -> Observation:
        return replace(o, pose_verdict=PoseVerdict.FROZEN) if int(now / 0.3) % 2 else o

    attempt = SimulatedAttempt(fault=flicker)
    assert attempt.run().aborted_by is not None
    assert attempt.commands == []
