"""One supervised flight of any kind: everything with a thread or a socket lives and dies here."""

import queue
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.sinks.crazyflie import CrazyfliePoseSink
from onboard.clock import Clock
from onboard.link import DroneLink
from perchhw.flight.actions import CommandRunner
from perchhw.flight.interrupts import OperatorInterrupts
from perchhw.flight.telemetry import Block, Telemetry, pose_recorder
from perchhw.record import RunRecorder
from perchhw.supervisor import (
    Event,
    FlightState,
    LinkDown,
    Mission,
    Phase,
    SafetyLimits,
    Tick,
    initial_state,
    step,
)

TICK_PERIOD = 0.02
"""Time between two looks of the supervisor, s."""

KICK_PERIOD = 0.2
"""Time between two kicks of the drone's emergency-stop watchdog, which bites after 1 s."""

_WATCHED_PHASES = frozenset(Phase) - {Phase.CHECKING, Phase.UPLOADING, Phase.DISARMING, Phase.DONE}
"""Phases in which a host that dies must stop the drone. The watchdog cannot be called off once kicked."""

OnPhase = Callable[[FlightState], None]


@dataclass(frozen=True)
class Flown:
    """How a supervised flight ended.

    Attributes:
        state: last state of the supervisor.
        trigger: the trigger snapshot, or None when the policy never fired.
        interrupted: the operator interrupted it.
    """

    state: FlightState
    trigger: dict[str, float] | None
    interrupted: bool


@dataclass
class SupervisedFlight:
    """A flight that is about to begin.

    Attributes:
        drone, mocap: URIs.
        mission: what the supervisor works towards.
        limits: safety limits.
        blocks: log blocks to record.
        commands: makes the runner of the commands for an open link.
        recorder: where everything goes.
        clock: monotonic clock, s.
        on_phase: called on each change of phase, for a display.
    """

    drone: str
    mocap: str
    mission: Mission
    limits: SafetyLimits
    blocks: tuple[Block, ...]
    commands: Callable[[DroneLink, "queue.Queue[Event]"], CommandRunner]
    recorder: RunRecorder
    clock: Clock
    on_phase: OnPhase | None

    def run(self) -> Flown:
        """Fly until the supervisor is done."""
        events: queue.Queue[Event] = queue.Queue()
        with ExitStack() as stack:
            interrupts = stack.enter_context(OperatorInterrupts(events))
            self.recorder.event("connecting", self.clock(), drone=self.drone, mocap=self.mocap)
            link = stack.enter_context(DroneLink.open(self.drone, clock=self.clock))
            bridge = PoseBridge(
                self.mocap,
                CrazyfliePoseSink(link),
                clock=self.clock,
                on_sample=pose_recorder(self.recorder),
            )
            stack.enter_context(bridge)
            telemetry = Telemetry(link, bridge, self.recorder, self.clock, self.blocks)
            telemetry.start()
            commands = self.commands(link, events)
            stack.callback(commands.close)
            state = self._supervise(link, bridge, telemetry, commands, events)
            trigger = telemetry.trigger_snapshot() if state.triggered else None
            if trigger is not None:
                self.recorder.write("trigger", self.clock(), trigger)
            return Flown(state, trigger, interrupts.count > 0)

    def _supervise(
        self,
        link: DroneLink,
        bridge: PoseBridge,
        telemetry: Telemetry,
        commands: CommandRunner,
        events: "queue.Queue[Event]",
    ) -> FlightState:
        """Feed the supervisor until it is done."""
        state = initial_state(self.clock())
        self._announce(state)
        kicked_at = next_tick = self.clock()
        while state.phase is not Phase.DONE:
            now = self.clock()
            if state.phase in _WATCHED_PHASES and now - kicked_at >= KICK_PERIOD:
                link.kick_emergency_stop_watchdog()
                kicked_at = now
            event = self._next_event(link, telemetry, events, next_tick)
            if isinstance(event, Tick):
                next_tick = max(next_tick + TICK_PERIOD, now)
            else:
                self.recorder.event(type(event).__name__, now, what=str(event))
            before = state
            state, orders = step(state, event, self.clock(), self.mission, self.limits)
            for order in orders:
                self.recorder.event("command", self.clock(), command=str(order.command), number=order.number)
                commands.submit(order)
            if state.phase is not before.phase:
                bridge.set_in_flight(state.phase in _WATCHED_PHASES)
                self._announce(state)
        return state

    def _next_event(
        self, link: DroneLink, telemetry: Telemetry, events: "queue.Queue[Event]", next_tick: float
    ) -> Event:
        """The next event: an answer, an interrupt, a lost link, or the tick that is due."""
        try:
            return events.get(timeout=max(0.0, next_tick - self.clock()))
        except queue.Empty:
            lost = link.lost
            return Tick(telemetry.observe()) if lost is None else LinkDown(f"link_lost: {lost}")

    def _announce(self, state: FlightState) -> None:
        now = self.clock()
        self.recorder.event("phase", now, phase=state.phase, aborted_by=state.aborted_by)
        self.recorder.write("supervisor", now, {"state": state.phase.value})
        if self.on_phase is not None:
            self.on_phase(state)
