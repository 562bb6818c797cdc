"""Fly one attempt: link and mocap open, the supervisor decides, its commands are carried out and recorded."""

import queue
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from calibration.flights import open_flight
from mocap_bridge.bridge import PoseBridge
from mocap_bridge.sinks.crazyflie import CrazyfliePoseSink
from mocap_bridge.uri import parse_mocap_uri
from onboard.clock import Clock, monotonic
from onboard.errors import PerchhwError
from onboard.link import DroneLink
from onboard.link.uri import check_drone_uri
from onboard.policy.bundle import bundle_crc32, encode_bundle
from onboard.policy.files import find_policy, load_policy
from onboard.vehicle import Vehicle, load_vehicle
from perchhw.attempt import AttemptInterrupted, AttemptRequest, AttemptResult, Outcome
from perchhw.flight.actions import CommandRunner
from perchhw.flight.interrupts import OperatorInterrupts
from perchhw.flight.mission import AttemptPlan, plan_attempt
from perchhw.flight.telemetry import Telemetry, pose_recorder
from perchhw.label import LabelError, label_flight
from perchhw.record import RunRecorder
from perchhw.supervisor import Event, FlightState, LinkDown, Phase, SafetyLimits, Tick, initial_state, step

TICK_PERIOD = 0.02
"""Time between two looks of the supervisor, s."""

KICK_PERIOD = 0.2
"""Time between two kicks of the drone's emergency-stop watchdog, which bites after 1 s."""

_WATCHED_PHASES = frozenset(Phase) - {Phase.CHECKING, Phase.UPLOADING, Phase.DISARMING, Phase.DONE}
"""Phases in which a host that dies must stop the drone. The watchdog cannot be called off once kicked."""

OnPhase = Callable[[FlightState], None]


def fly_attempt(
    request: AttemptRequest,
    *,
    dry_run: bool = False,
    clock: Clock = monotonic,
    limits: SafetyLimits | None = None,
    on_phase: OnPhase | None = None,
) -> AttemptResult:
    """Fly one supervised attempt and label it.

    Args:
        request: what to fly, where, with which policy; `request.folder` is created for the record.
        dry_run: stop after the verified policy upload; the motors never arm.
        clock: monotonic clock, s.
        limits: safety limits; by default the documented ones in the request's room.
        on_phase: called on each change of phase, for a display.

    Returns:
        The result. An attempt that a safety rule or the operator ended has the outcome ``aborted``.

    Raises:
        PerchhwError: no link, unusable policy or vehicle, or an approach that does not fit the room; the
            record holds the reason when it was already open.
        AttemptInterrupted: the operator interrupted; the drone was stopped and the record closed first.
    """
    check_drone_uri(request.drone)
    parse_mocap_uri(request.mocap)
    vehicle = load_vehicle(request.vehicle, request.legs)
    bundle = encode_bundle(load_policy(find_policy(request.policy)))
    plan = plan_attempt(request, bundle_crc32(bundle), dry_run)
    limits = limits or SafetyLimits(room=request.room)
    with RunRecorder(request.folder, _configuration(request, vehicle, plan), clock) as recorder:
        flight = _Flight(request, plan, bundle, limits, recorder, clock, on_phase)
        try:
            state, trigger, interrupted = flight.run()
        except PerchhwError as error:
            recorder.event("refused", clock(), reason=str(error))
            recorder.close(outcome=Outcome.ABORTED, aborted_by=str(error))
            raise
        result = _conclude(request, vehicle, state, trigger, recorder, clock)
    if interrupted:
        raise AttemptInterrupted(result)
    return result


def _configuration(request: AttemptRequest, vehicle: Vehicle, plan: AttemptPlan) -> dict[str, Any]:
    """What ``run.json`` says about the attempt."""
    return {
        "speed_m_s": request.speed,
        "angle_deg": request.angle_deg,
        "index": request.index,
        "try_number": request.try_number,
        "drone": request.drone,
        "mocap": request.mocap,
        "policy": request.policy,
        "policy_crc32": f"{plan.mission.policy_crc:08x}",
        "vehicle": vehicle.name,
        "legs": None if vehicle.legs is None else vehicle.legs.design,
        "ceiling_z": request.room.ceiling_z,
        "seed": request.seed,
        "approach": {name: float(value) for name, value in plan.approach._asdict().items()},
        "dry_run": plan.mission.dry_run,
    }


def _conclude(
    request: AttemptRequest,
    vehicle: Vehicle,
    state: FlightState,
    trigger: dict[str, float] | None,
    recorder: RunRecorder,
    clock: Clock,
) -> AttemptResult:
    """Label what was flown and close the record."""
    outcome, evidence, aborted_by = Outcome.ABORTED, {}, state.aborted_by
    if aborted_by is None and state.armed:
        try:
            label = label_flight(open_flight(request.folder, "perchhw"), vehicle, request.room.ceiling_z)
        except LabelError as error:
            aborted_by = state.link_lost or f"label: {error}"
        else:
            outcome, evidence = label.outcome, label.evidence
    recorder.event("labelled", clock(), outcome=outcome, evidence=evidence)
    result = AttemptResult(outcome, state.triggered, trigger, aborted_by, request.folder)
    recorder.close(
        outcome=outcome, triggered=state.triggered, trigger=trigger, aborted_by=aborted_by, evidence=evidence
    )
    return result


@dataclass
class _Flight:
    """The running attempt: everything with a thread or a socket lives and dies in :meth:`run`."""

    request: AttemptRequest
    plan: AttemptPlan
    bundle: bytes
    limits: SafetyLimits
    recorder: RunRecorder
    clock: Clock
    on_phase: OnPhase | None

    def run(self) -> tuple[FlightState, dict[str, float] | None, bool]:
        """Fly until the supervisor is done; gives its last state, the trigger snapshot, and "interrupted"."""
        events: queue.Queue[Event] = queue.Queue()
        with ExitStack() as stack:
            interrupts = stack.enter_context(OperatorInterrupts(events))
            self.recorder.event(
                "connecting", self.clock(), drone=self.request.drone, mocap=self.request.mocap
            )
            link = stack.enter_context(DroneLink.open(self.request.drone, clock=self.clock))
            bridge = PoseBridge(
                self.request.mocap,
                CrazyfliePoseSink(link),
                clock=self.clock,
                on_sample=pose_recorder(self.recorder),
            )
            stack.enter_context(bridge)
            telemetry = Telemetry(link, bridge, self.recorder, self.clock)
            telemetry.start()
            commands = CommandRunner(link, self.plan, self.bundle, self.request.room.ceiling_z, events)
            stack.callback(commands.close)
            state = self._supervise(link, bridge, telemetry, commands, events)
            trigger = telemetry.trigger_snapshot() if state.triggered else None
            if trigger is not None:
                self.recorder.write("trigger", self.clock(), trigger)
            return state, trigger, interrupts.count > 0

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
            state, orders = step(state, event, self.clock(), self.plan.mission, self.limits)
            for command in orders:
                self.recorder.event("command", self.clock(), command=str(command))
                commands.submit(command)
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
