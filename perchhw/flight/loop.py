"""The loop between the world and the supervisor. Nothing that it calls can end it: every exception of ours is
kept, told to the supervisor, which lands, and reported after the flight."""

import logging
import queue
import traceback
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from mocap_bridge.bridge import PoseBridge
from onboard.link import DroneLink
from onboard.link.stop import LONGEST_S
from onboard.timebase import Queue, Timebase
from perchhw.flight.actions import CommandRunner
from perchhw.flight.caught import Caught
from perchhw.flight.host_load import Lateness
from perchhw.flight.interrupts import OperatorInterrupts
from perchhw.flight.kicker import HEART_S, WatchdogKicker
from perchhw.flight.recording import FlightRecorder
from perchhw.flight.telemetry import Telemetry
from perchhw.supervisor import (
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
    SafetyLimits,
    StopConfirmed,
    StopUnconfirmed,
    Tick,
    initial_state,
    step,
)
from perchhw.supervisor.events import EmergencyStop, HostStoodStill

TICK_PERIOD = 0.02
"""Time between two looks of the supervisor, s."""

WATCHED_PHASES = frozenset(Phase) - {
    Phase.CHECKING,
    Phase.UPLOADING,
    Phase.READY,
    Phase.DISARMING,
    Phase.STOPPING,
    Phase.DONE,
}
"""Phases in which a host that dies must stop the drone. The watchdog cannot be called off once kicked."""

OnPhase = Callable[[FlightState], None]
OnLook = Callable[[FlightState, Observation], None]
_T = TypeVar("_T")
_log = logging.getLogger(__name__)


@dataclass
class FlightLoop:
    """Feeds the supervisor until it is done.

    Attributes:
        clock: time of the flight.
        link, bridge, telemetry, commands, record, interrupts, kicker: the flight's parts, all running.
        events: where answers to orders come.
        mission, limits: what the supervisor works towards, and within what.
        lateness: is told how late each look of the supervisor is.
        on_phase: called when the phase or the alert changes, for a display.
        on_look: called with every look of the supervisor, for a display. Both must return at once; one that
            fails is not called again, and the flight goes on.
        state: where the flight stands.
    """

    clock: Timebase
    link: DroneLink
    bridge: PoseBridge
    telemetry: Telemetry
    commands: CommandRunner
    record: FlightRecorder
    interrupts: OperatorInterrupts
    kicker: WatchdogKicker
    events: Queue
    mission: Mission
    limits: SafetyLimits
    on_phase: OnPhase | None
    on_look: OnLook | None = None
    lateness: Lateness = field(default_factory=Lateness)
    state: FlightState = field(init=False)

    def __post_init__(self) -> None:
        self._own_events: deque[Event] = deque()
        self._told: set[str] = set()
        self._time = 0.0
        self._next_tick = 0.0
        self._beaten_at: float | None = None
        self._stillest = 0.0
        self._pause = self.clock.event()
        self.state = initial_state(self._now())

    def run(self) -> FlightState:
        """Feed the supervisor; its last state."""
        self._next_tick = self._now()
        try:
            self._announce()
            while self.state.phase is not Phase.DONE:
                self._safely(self._beat, None)
                self._advance(self._next_event())
        except BaseException:  # of the interpreter, none of ours: the drone must not fly on without us
            self.link.stop_path.trigger()
            raise
        return self.state

    def _beat(self) -> None:
        """The heart of the supervisor. Where it did not beat, nobody kicked the drone's watchdog either."""
        self._stood_still()
        watched = self.lateness.watched = self.state.phase in WATCHED_PHASES
        self._beaten_at = self._now() if watched else None
        self.kicker.beat(watched)

    def _stood_still(self) -> Event | None:
        if self._beaten_at is not None:
            self._stillest = max(self._stillest, self._now() - self._beaten_at)
        longest = max(HEART_S, self.limits.telemetry_age)  # what may be seen late may be looked at late
        if self._stillest <= longest:
            return None
        return HostStoodStill(f"{self._stillest:.2g} s, need at most {longest:g} s")

    # What goes in

    def _next_event(self) -> Event:
        """What the loop itself has noticed, else an answer, else the tick that is due."""
        event = self._noticed() or self._next_answer()
        if isinstance(event, CommandFailed):
            # A command that fails because the link is gone says less than the link does.
            self._own_events.append(event)
            event = self._noticed()
        if event is not None:
            return event
        observation = self._safely(self._observation, Observation())
        # A key before a look at what came of it, or the drone that it stopped would be blamed.
        event = self._noticed()
        if event is not None:
            return event
        now = self._now()
        self._safely(lambda: self.lateness.note(now - self._next_tick), None)
        self._next_tick = max(self._next_tick + TICK_PERIOD, now)
        return Tick(observation)

    def _noticed(self) -> Event | None:
        """News of the loop's own, each told once."""
        for name, look in (
            ("stop", self._stop_report),
            ("cut", lambda: OperatorAbort(urgent=True) if self.interrupts.count > 1 else None),
            ("land", lambda: OperatorAbort() if self.interrupts.count > 0 else None),
            ("stood still", self._stood_still),
            ("link", self._link_lost),
            ("record", lambda: RecordLost(why) if (why := self.record.look_for_loss()) is not None else None),
            ("kicker", lambda: InternalError(why) if (why := self.kicker.problem) is not None else None),
        ):
            event = None if name in self._told else self._safely(look, None)
            if event is not None:
                self._told.add(name)
                return event
        return self._own_events.popleft() if self._own_events else None

    def _stop_report(self) -> Event | None:
        if self.state.phase is not Phase.STOPPING:
            return None
        report = self.link.stop_path.report
        if report is None:
            return None
        return StopConfirmed() if report.locked else StopUnconfirmed(report.reason)

    def _link_lost(self) -> Event | None:
        lost = self.link.lost
        return None if lost is None else LinkDown(f"link_lost: {lost}")

    def _observation(self) -> Observation:
        return self.telemetry.observe()

    def _next_answer(self) -> Event | None:
        with Caught(self._keep):
            return self._answer()
        self._safely(lambda: self._pause.wait(TICK_PERIOD), False)  # no answers any more, but the same pace
        return None

    def _answer(self) -> Event | None:
        """An answer to an order, waited for until the next tick."""
        try:
            answer: Event = self.events.get(timeout=min(max(0.0, self._next_tick - self._now()), TICK_PERIOD))
        except queue.Empty:
            return None
        return answer

    # What comes out

    def _advance(self, event: Event) -> None:
        """One step of the supervisor, and what follows from it."""
        if not isinstance(event, Tick):
            self._note(type(event).__name__, self._now(), what=str(event))
        before = self.state
        self.state, orders = self._step(event)
        self._safely(lambda: self.commands.retire(self.state.oldest_in_force), None)
        for order in orders:
            self._give(order)
        if self.state.phase is not before.phase:
            self._safely(lambda: self.bridge.set_in_flight(self.state.phase in WATCHED_PHASES), None)
        if (self.state.phase, self.state.alert) != (before.phase, before.alert):
            self._announce()
        on_look = self.on_look
        if on_look is not None and isinstance(event, Tick):
            with Caught(self._stop_showing):
                on_look(self.state, event.observation)

    def _step(self, event: Event) -> tuple[FlightState, tuple[Order, ...]]:
        now = self._now()
        for news in (event, InternalError("the supervisor failed")):
            with Caught(self._keep):
                return step(self.state, news, now, self.mission, self.limits)
        return self._without_supervisor(), ()

    def _without_supervisor(self) -> FlightState:
        """The supervisor itself is broken: nobody can land this drone any more."""
        self.link.stop_path.trigger()
        deadline = self._now() + LONGEST_S
        while self.link.stop_path.report is None and self._now() < deadline:
            self._pause.wait(TICK_PERIOD)
        why = self.state.aborted_by or "internal_error: the supervisor failed"
        return replace(self.state, phase=Phase.DONE, aborted_by=why)

    def _give(self, order: Order) -> None:
        """A stop before anything else that this loop does."""
        with Caught(lambda error: self._not_given(order, error)):
            if isinstance(order.command, EmergencyStop):
                self.link.stop_path.trigger()
            else:
                self.commands.submit(order)
        self._note("command", self._now(), command=str(order.command), number=order.number)

    def _not_given(self, order: Order, error: BaseException) -> None:
        self._keep(error)
        if isinstance(order.command, EmergencyStop):
            self._own_events.append(StopUnconfirmed(repr(error)))
        else:
            self._own_events.append(CommandFailed(order, repr(error)))

    def _announce(self) -> None:
        state, now = self.state, self._now()
        self._note("phase", now, phase=state.phase, aborted_by=state.aborted_by, **_alert(state.alert))
        self._safely(lambda: self.record.write("supervisor", now, {"state": state.phase.value}), None)
        on_phase = self.on_phase
        if on_phase is not None:
            with Caught(self._stop_showing):
                on_phase(state)

    # Errors of ours

    def _stop_showing(self, error: BaseException) -> None:
        """Nobody sees the flight any more; that is no reason to end it."""
        self.on_phase = self.on_look = None
        _log.error("the display of this flight failed; the flight goes on", exc_info=error)

    def _now(self) -> float:
        """The time; without a clock it goes on by a tick a call, so that deadlines come."""
        self._time = self._safely(self._clock_reading, self._time + TICK_PERIOD)
        return self._time

    def _clock_reading(self) -> float:
        return self.clock()

    def _safely(self, call: Callable[[], _T], otherwise: _T) -> _T:
        with Caught(self._keep):
            return call()
        return otherwise

    def _keep(self, error: BaseException) -> None:
        """Remember an error of ours; the supervisor is told of the first."""
        self._tell(error)
        told = "".join(traceback.format_exception(error))
        self._note("internal_error", self._time, error=repr(error), traceback=told)

    def _note(self, name: str, t: float, **fields: Any) -> None:
        """Put an event on record. A recorder that raises, which it must not, is an error like any other."""
        with Caught(self._tell):
            self.record.event(name, t, **fields)

    def _tell(self, error: BaseException) -> None:
        _log.error("error in perchhw during the flight; the drone lands first", exc_info=error)
        if "internal" not in self._told:
            self._told.add("internal")
            self._own_events.append(InternalError(repr(error)))


def _alert(alert: str | None) -> dict[str, str]:
    return {} if alert is None else {"alert": alert}
