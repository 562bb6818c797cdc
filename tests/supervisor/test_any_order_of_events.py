"""The pure machine under random events in random order: what must hold whatever happens."""

from dataclasses import dataclass, field, replace
from math import inf, nan
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from mocap_bridge.health import PoseVerdict
from onboard.app_interface import EndReason, LandingState
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import (
    CommandDone,
    CommandFailed,
    Event,
    FlightState,
    InternalError,
    LinkDown,
    Mission,
    Observation,
    OperatorAbort,
    Order,
    Phase,
    RecordLost,
    StopConfirmed,
    StopUnconfirmed,
    Tick,
    initial_state,
    step,
)
from perchhw.supervisor.events import (
    Arm,
    ArmApproach,
    Brake,
    Disarm,
    DisarmPolicy,
    EmergencyStop,
    FlyCourse,
    GoTo,
    HostStoodStill,
    Land,
    StartApproach,
    TakeOff,
    UploadPolicy,
)
from tests.drawn_examples import examples

from .simulated_attempt import CRC, FLYING, INVERTED, MISSION, READY
from .states import ALL_PHASES, good_in, mission_of, state_in

PLAN_ORDER = (UploadPolicy, Arm, TakeOff, GoTo, ArmApproach, FlyCourse, StartApproach)
"""Commands of the plan, in its order; a test flight has a course instead of an approach."""
WAYS_OUT = (Brake, DisarmPolicy, Land, Disarm, EmergencyStop)
LONGEST = 60.0
"""s within which any phase, left to itself, has ended; a mission has no phase whose deadline is longer."""

CHANGES: dict[str, list[Any]] = {
    "link_silence": [None, 0.7, 2.0, nan, -1.0],
    "pose_verdict": [None, *PoseVerdict],
    "pose_age": [None, 0.2, 0.4, 5.0, nan, -0.1],
    "pose_position": [None, (0.0, 0.0, 2.0), (0.0, 2.0, 1.0), (nan, 0.0, 0.0)],
    "pose_quaternion": [None, INVERTED, (0.0, 0.0, 0.0, 0.0)],
    "estimate_age": [None, 0.2, 0.5, 2.0, inf],
    "estimate_position": [None, (-3.0, 0.0, 0.05), MISSION.start, (0.0, 0.0, 1e9)],
    "estimate_velocity": [None, (0.0, 0.0, 3.0), (nan, nan, nan)],
    "estimate_quaternion": [None, INVERTED, (nan, 0.0, 0.0, 1.0)],
    "rates_age": [None, 1.0],
    "body_rates": [None, (0.0, 30.0, 0.0)],
    "drone": [
        None,
        *(SupervisorInfo(bits) for bits in (0, READY, FLYING, SupervisorBits.LOCKED, SupervisorBits.TUMBLED)),
    ],
    "drone_age": [None, 0.3, 2.0, -5.0],
    "battery_voltage": [None, 2.5, 99.0],
    "landing_state": [None, *LandingState],
    "landing_age": [None, 0.5],
    "end_reason": [None, *EndReason],
    "trigger_count": [None, 0, 1],
    "active_policy_crc": [None, 0, CRC],
    "policy_armed": [None, False, True],
    "trajectory_armed": [None, False, True],
    "parameters_ok": [None, False, True],
}


@st.composite
def observations(draw: st.DrawFn) -> Observation:
    """What is well in some phase, with up to three values changed."""
    o = good_in(draw(st.sampled_from(ALL_PHASES)))
    for name in draw(st.lists(st.sampled_from(sorted(CHANGES)), max_size=3, unique=True)):
        o = replace(o, **{name: draw(st.sampled_from(CHANGES[name]))})
    return o


COMMANDS = st.sampled_from(
    [
        UploadPolicy(),
        Arm(),
        TakeOff(0.6, 2.0),
        GoTo(MISSION.start, 2.0),
        ArmApproach(),
        StartApproach(),
        FlyCourse(),
        Brake(),
        DisarmPolicy(),
        Land(3.5),
        Disarm(),
        EmergencyStop(),
    ]
)


@dataclass(frozen=True)
class Answer:
    """To the order so many before the newest, or to one that was never given."""

    back: int
    failed: bool
    invented: Any = None


EVENTS: st.SearchStrategy[Event | Answer] = st.one_of(
    observations().map(Tick),
    observations().map(Tick),
    st.builds(Answer, st.integers(0, 4), st.booleans(), st.none() | COMMANDS),
    st.sampled_from([StopConfirmed(), StopUnconfirmed("silent"), LinkDown("gone")]),
    st.sampled_from([RecordLost("disk full"), InternalError("ValueError"), OperatorAbort()]),
    st.just(HostStoodStill("2 s, need at most 0.3 s")),
    st.just(OperatorAbort(urgent=True)),
)
WAITS = st.one_of(st.sampled_from([0.0, 0.02, 0.02, 0.02, 0.5, 3.0, 30.0]), st.sampled_from([-10.0, nan]))


@dataclass
class Flight:
    """A machine with a memory of what it ordered, that checks every step."""

    state: FlightState
    mission: Mission
    given: list[Order] = field(default_factory=list)
    now: float = 0.0

    def feed(self, event: Event | Answer, wait: float) -> None:
        now = self.now + wait
        self.now = now if now == now else self.now
        if isinstance(event, Answer):
            event = self._answer(event)
        before = self.state
        aborted = before.aborted_by is not None
        self.state, orders = step(before, event, now, self.mission)
        for order in orders:
            self._check(order, before, aborted)
            self.given.append(order)
        self._check_event(event, before)

    def _answer(self, answer: Answer) -> Event:
        newest = self.state.orders_given
        command = answer.invented
        order = Order(newest - answer.back, command or Land(3.5))
        if command is None and answer.back < len(self.given):
            order = self.given[-1 - answer.back]
        return CommandFailed(order, "no answer") if answer.failed else CommandDone(order, CRC)

    def _check(self, order: Order, before: FlightState, aborted: bool) -> None:
        numbers = [o.number for o in self.given]
        assert order.number == (numbers[-1] if numbers else before.orders_given) + 1
        commands = [type(o.command) for o in self.given]
        assert EmergencyStop not in commands, "nothing is ordered after a stop"
        if aborted:
            assert isinstance(order.command, WAYS_OUT), "what was aborted only comes down"
        if isinstance(order.command, PLAN_ORDER):
            assert not any(isinstance(o.command, WAYS_OUT) for o in self.given), "no way back into the plan"
            planned = [PLAN_ORDER.index(c) for c in commands if c in PLAN_ORDER]
            assert PLAN_ORDER.index(type(order.command)) > max(planned, default=-1)

    def _check_event(self, event: Event, before: FlightState) -> None:
        stopped = any(isinstance(o.command, EmergencyStop) for o in self.given)
        if before.phase in (Phase.DONE, Phase.STOPPING):
            return
        match event:
            case OperatorAbort(urgent=True):
                assert stopped == before.arm_ordered
                assert self.state.phase is (Phase.STOPPING if stopped else Phase.DONE)
            case LinkDown() if before.phase not in (Phase.FLIPPING, Phase.SETTLING):
                assert stopped == before.arm_ordered
            case RecordLost() if self.state.phase not in (Phase.DONE, Phase.STOPPING):
                assert self.state.record_lost is not None
            case InternalError():
                assert self.state.aborted_by is not None
        if self.state.phase is Phase.STOPPING:
            assert stopped
        if self.state.phase is Phase.DONE and self.state.arm_ordered:
            # Not before somebody confirmed that the motors are off, except where no link was left to ask.
            assert before.phase is Phase.DISARMING or isinstance(event, LinkDown)


@settings(max_examples=examples(300), deadline=None)
@given(
    st.sampled_from(ALL_PHASES),
    st.lists(st.tuples(EVENTS, WAITS), max_size=40),
    st.sampled_from(["silence", "frozen", "error"]),
)
def test_whatever_happens_the_flight_comes_down_and_ends(
    phase: Phase, sequence: list[tuple[Event | Answer, float]], left_with: str
) -> None:
    flight = Flight(state_in(phase), mission_of(phase))
    for event, wait in sequence:
        flight.feed(event, wait)
    last = next((e for e, _ in reversed(sequence) if isinstance(e, Tick)), Tick(Observation()))
    alone = {"silence": Tick(Observation()), "frozen": last, "error": InternalError("OSError")}[left_with]
    flight.feed(alone, 0.25)
    started = flight.state.time
    while flight.state.phase is not Phase.DONE:
        flight.feed(alone, 0.25)
        assert flight.state.time - started < LONGEST, f"stuck in {flight.state.phase}"


@settings(max_examples=examples(100), deadline=None)
@given(st.lists(st.tuples(EVENTS, WAITS), max_size=60))
def test_from_the_ground_no_step_of_the_plan_is_skipped(
    sequence: list[tuple[Event | Answer, float]],
) -> None:
    flight = Flight(initial_state(0.0), MISSION)
    for event, wait in sequence:
        flight.feed(event, wait)
    ordered = [type(o.command) for o in flight.given if isinstance(o.command, PLAN_ORDER)]
    plan = [command for command in PLAN_ORDER if command is not FlyCourse]
    assert ordered == plan[: len(ordered)]


@settings(max_examples=examples(100), deadline=None)
@given(st.sampled_from(ALL_PHASES[:-1]), EVENTS.filter(lambda e: not isinstance(e, Answer)))
def test_an_event_twice_is_an_event_once(phase: Phase, event: Event) -> None:
    """A repeated abort, loss or error never makes things worse than the first."""
    if isinstance(event, Tick):
        return
    once = step(state_in(phase), event, 0.01, mission_of(phase))
    twice = step(once.state, event, 0.01, mission_of(phase))
    assert twice.orders == ()
    if once.state.phase is not phase:
        assert twice.state.phase is once.state.phase
