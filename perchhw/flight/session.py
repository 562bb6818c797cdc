"""One supervised flight of any kind: everything with a thread or a socket lives and dies here."""

import logging
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.correction import AS_TRACKED, PoseCorrection
from onboard.app_interface import Parameter
from onboard.link import DroneLink
from onboard.link.exclusive import hold
from onboard.link.landing_app import engine_of
from onboard.link.power import refuse_flying
from onboard.timebase import WALL, Queue, Timebase
from perchhw.flight.actions import CommandRunner
from perchhw.flight.caught import Caught
from perchhw.flight.host_load import Lateness, host_load
from perchhw.flight.interrupts import OperatorInterrupts
from perchhw.flight.kicker import WatchdogKicker
from perchhw.flight.loop import FlightLoop, OnLook, OnPhase
from perchhw.flight.readback import OWN_LAW, ReadBack
from perchhw.flight.recording import FlightRecorder
from perchhw.flight.telemetry import Telemetry, TelemetryBlock, pose_recorder
from perchhw.supervisor import FlightState, Mission, SafetyLimits

_log = logging.getLogger(__name__)

CommandsFor = Callable[[DroneLink, Queue, ReadBack], CommandRunner]
"""Makes the runner of a flight's commands for an open link."""


@dataclass(frozen=True)
class FlightEnd:
    """How a supervised flight ended.

    Attributes:
        state: last state of the supervisor.
        trigger: the trigger snapshot, or None when the policy never fired.
        interrupted: the operator interrupted it.
        drone_clock_rate: s of the drone's clock in a second of the flight's, or None.
    """

    state: FlightState
    trigger: dict[str, float] | None
    interrupted: bool
    drone_clock_rate: float | None


@dataclass
class SupervisedFlight:
    """A flight that is about to begin.

    Attributes:
        drone, mocap: URIs.
        mission: what the supervisor works towards.
        limits: safety limits.
        blocks: log blocks to record.
        settings: parameters of the drone and the values that they must have.
        commands: makes the runner of the commands.
        record: where everything goes.
        clock: time of the flight.
        on_phase: called when the phase or the alert changes, for a display.
        correction: of the poses, before anything else sees them.
        on_look: called with every look of the supervisor, for a display.
        own_law: the drone is told to leave nothing to its firmware's PID.
    """

    drone: str
    mocap: str
    mission: Mission
    limits: SafetyLimits
    blocks: tuple[TelemetryBlock, ...]
    settings: Mapping[str, int]
    commands: CommandsFor
    record: FlightRecorder
    clock: Timebase
    on_phase: OnPhase | None
    correction: PoseCorrection = AS_TRACKED
    on_look: OnLook | None = None
    own_law: bool = False

    def run(self) -> FlightEnd:
        """Fly until the supervisor is done. What fails once it is does not cost the result.

        Raises:
            PerchhwError: no link, or something else without which the flight does not begin.
        """
        stack, interrupts, lateness = ExitStack(), OperatorInterrupts(), Lateness()
        try:
            flown = self._fly(stack, interrupts, lateness)
        except BaseException:
            with stack:
                raise
        with Caught(self._not_closed):
            stack.close()
        if self.clock is WALL:
            self.record.update(host={**host_load(), "late_s": lateness.worst})
        return replace(flown, interrupted=interrupts.count > 0)  # also while it closed

    def _not_closed(self, error: BaseException) -> None:
        self.record.event("internal_error", self.clock(), error=repr(error))
        _log.error("error in perchhw while it closed a flight that was over", exc_info=error)

    def _fly(self, stack: ExitStack, interrupts: OperatorInterrupts, lateness: Lateness) -> FlightEnd:
        """Everything is open in `stack`."""
        clock, record = self.clock, self.record
        stack.enter_context(interrupts)
        record.event("connecting", clock(), drone=self.drone, mocap=self.mocap)
        if clock is WALL:  # a lab with a time of its own stands still for who connects: nobody flies in it
            stack.enter_context(hold(self.drone))
            refuse_flying(self.drone, clock)
        link = stack.enter_context(DroneLink.open(self.drone, clock=clock))
        readback, events = ReadBack(), clock.queue()
        if self.own_law:
            link.set_param(Parameter.OWN_LAW, 1)
        readback.check_settings(link, {**self.settings, **OWN_LAW} if self.own_law else self.settings)
        record.update(engine=engine_of(link))
        bridge = PoseBridge(
            self.mocap,
            link,
            clock=clock,
            on_sample=pose_recorder(record),
            correction=self.correction,
        )
        stack.enter_context(bridge)
        telemetry = Telemetry(link, bridge, record, readback, clock, self.blocks, lateness)
        telemetry.start()
        commands = self.commands(link, events, readback)
        stack.callback(commands.close)
        loop = FlightLoop(
            clock=clock,
            link=link,
            bridge=bridge,
            telemetry=telemetry,
            commands=commands,
            record=record,
            interrupts=interrupts,
            kicker=stack.enter_context(WatchdogKicker(link, clock)),
            events=events,
            mission=replace(self.mission, arm_at=clock.slot()),
            limits=self.limits,
            on_phase=self.on_phase,
            on_look=self.on_look,
            lateness=lateness,
        )
        interrupts.stop_by(lambda: _cut_motors(loop))
        state = loop.run()
        trigger = telemetry.trigger_snapshot() if state.triggered else None
        if trigger is not None:
            record.write("trigger", clock(), trigger)
        return FlightEnd(state, trigger, interrupts.count > 0, telemetry.drone_clock_rate())


def _cut_motors(loop: FlightLoop) -> None:
    """What the second key does beside the supervisor: nothing to a drone that was never asked to arm, which
    a stop would lock for nothing. The loop's state says so before the order to arm goes out."""
    if loop.state.arm_ordered:
        loop.link.stop_path.trigger()
