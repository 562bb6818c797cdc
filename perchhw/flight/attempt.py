"""Fly one attempt: link and mocap open, the supervisor decides, its commands are carried out and recorded."""

from dataclasses import replace
from typing import Any, NamedTuple

from calibration.flights import open_flight
from mocap_bridge.uri import parse_mocap_uri
from onboard.errors import PerchhwError
from onboard.lab_time import open_timebase
from onboard.link import DroneLink
from onboard.link.uri import check_drone_uri
from onboard.policy.bundle import bundle_crc32, encode_bundle
from onboard.policy.files import find_policy, load_policy
from onboard.record.recorder import require_space
from onboard.timebase import Queue, Timebase
from onboard.vehicle import Vehicle, load_vehicle
from perchhw.attempt import AttemptInterrupted, AttemptRequest, AttemptResult, Outcome
from perchhw.flight.actions import LandingCommands
from perchhw.flight.explain import explain, refusal_recorded
from perchhw.flight.fit import Fit, fit_of
from perchhw.flight.interrupts import OperatorInterrupts
from perchhw.flight.loop import OnLook, OnPhase
from perchhw.flight.mission import AttemptPlan, plan_attempt
from perchhw.flight.readback import LANDING_SETTINGS, ReadBack
from perchhw.flight.recording import FlightRecorder, RecordListener
from perchhw.flight.session import FlightEnd, SupervisedFlight
from perchhw.flight.telemetry import BLOCKS
from perchhw.lab import correction_of, flies_by_own_law, in_record, limits_of, require_lab
from perchhw.label import label_flight
from perchhw.record import RunRecorder
from perchhw.supervisor import FlightState, SafetyLimits

DRY_RUN_PASSED = "dry_run_passed"
"""Outcome in the record of a dry run whose checks and upload passed; nothing was flown."""


class CheckedAttempt(NamedTuple):
    """What a request asks for, found to be usable and to fit together before anybody is connected."""

    vehicle: Vehicle
    fit: Fit
    bundle: bytes
    plan: AttemptPlan


def check_attempt(request: AttemptRequest, dry_run: bool = False) -> CheckedAttempt:
    """Refuse what cannot be flown; touches neither drone nor motion capture.

    Raises:
        PerchhwError: unusable addresses, policy or vehicle, hardware without a lab file, parts that do not
            belong together, an approach that does not fit the room, or a disk without room for the record.
    """
    check_drone_uri(request.drone)
    parse_mocap_uri(request.mocap)
    require_lab(request.drone, request.mocap, request.lab)
    vehicle = load_vehicle(request.vehicle, request.legs)
    policy = load_policy(find_policy(request.policy))
    fit = fit_of(request, policy, vehicle)
    fit.require(request.accept_mismatch)
    bundle = encode_bundle(policy)
    require_space(request.folder)
    return CheckedAttempt(vehicle, fit, bundle, plan_attempt(request, bundle_crc32(bundle), dry_run))


def fly_attempt(
    request: AttemptRequest,
    *,
    dry_run: bool = False,
    checked: CheckedAttempt | None = None,
    limits: SafetyLimits | None = None,
    on_phase: OnPhase | None = None,
    on_look: OnLook | None = None,
    listener: RecordListener | None = None,
) -> AttemptResult:
    """Fly one supervised attempt and label it.

    Args:
        request: what to fly, where, with which policy; `request.folder` is created for the record.
        dry_run: stop after the verified policy upload; the motors never arm.
        checked: what :func:`check_attempt` said of this request and `dry_run`; by default it is asked here.
        limits: safety limits; by default the documented ones and those of the lab file.
        on_phase: called when the phase or the alert changes, for a display.
        on_look: called with every look of the supervisor, for a display.
        listener: hears what is recorded, for a ground station.

    Returns:
        The result. An attempt that a safety rule or the operator ended has the outcome ``aborted``.

    Raises:
        PerchhwError: no link, unusable policy or vehicle, or an approach that does not fit the room; the
            record holds the reason when it was already open.
        AttemptInterrupted: the operator interrupted; the drone was stopped and the record closed first.
    """
    vehicle, fit, bundle, plan = checked or check_attempt(request, dry_run)
    limits = limits or limits_of(request.lab, request.room, request.drone)
    with (
        open_timebase("fly", request.drone, request.mocap) as clock,
        RunRecorder(request.folder, _configuration(request, vehicle, plan, fit), clock) as recorder,
        FlightRecorder(recorder, listener) as record,
    ):

        def prepared(link: DroneLink, events: Queue, readback: ReadBack) -> LandingCommands:
            refused = fit.ask_drone(link, vehicle, request.accept_mismatch)
            if refused is not None:
                readback.refuse(refused)
            record.update(accepted_mismatches=fit.mismatches)
            flashed = None if request.accept_mismatch else vehicle
            return LandingCommands(link, events, clock, readback, plan, bundle, flashed)

        flight = SupervisedFlight(
            drone=request.drone,
            mocap=request.mocap,
            mission=plan.mission,
            limits=limits,
            blocks=BLOCKS,
            settings=LANDING_SETTINGS,
            commands=prepared,
            record=record,
            clock=clock,
            on_phase=on_phase,
            on_look=on_look,
            correction=correction_of(request.lab),
            own_law=flies_by_own_law(request.lab, request.drone),
        )
        with refusal_recorded(record, clock, request.folder):
            flown = flight.run()
        with OperatorInterrupts() as late:  # a landing that was flown is labelled
            result = _conclude(request, vehicle, fit, flown, record, clock)
    with OperatorInterrupts() as later:  # and explained
        result = replace(result, diagnosis=explain(request.folder))
    if flown.interrupted or late.count + later.count > 0:
        raise AttemptInterrupted(result)
    return result


def _configuration(request: AttemptRequest, vehicle: Vehicle, plan: AttemptPlan, fit: Fit) -> dict[str, Any]:
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
        "ceiling_z": float(plan.approach.ceiling_z),
        **in_record(request.lab, request.room),
        "seed": request.seed,
        "approach": {name: float(value) for name, value in plan.approach._asdict().items()},
        "dry_run": plan.mission.dry_run,
        "operator": request.operator,
        "note": request.note,
        "not_compared": fit.unknown,
    }


def _conclude(
    request: AttemptRequest,
    vehicle: Vehicle,
    fit: Fit,
    flown: FlightEnd,
    record: FlightRecorder,
    clock: Timebase,
) -> AttemptResult:
    """Label what was flown and close the record."""
    state, trigger = flown.state, flown.trigger
    outcome, evidence, aborted_by = Outcome.ABORTED, {}, state.aborted_by
    if aborted_by is None and state.armed:
        record.settle()
        try:
            label = label_flight(open_flight(request.folder, "perchhw"), vehicle)
        except PerchhwError as error:
            aborted_by = _why_no_label(state, error)
        else:
            outcome, evidence = label.outcome, label.evidence
    dry_run_passed = aborted_by is None and not state.armed
    told = DRY_RUN_PASSED if dry_run_passed else outcome
    record.event("labelled", clock(), outcome=told, evidence=evidence)
    result = AttemptResult(
        outcome=outcome,
        triggered=state.triggered,
        trigger=trigger,
        aborted_by=aborted_by,
        record=request.folder,
        halt=_halt(state),
        fell=state.fell,
        accepted_mismatches=fit.mismatches,
        not_compared=fit.unknown,
    )
    record.close(
        outcome=told,
        triggered=state.triggered,
        trigger=trigger,
        aborted_by=aborted_by,
        fell=state.fell,
        evidence=evidence,
        drone_clock_rate=flown.drone_clock_rate,
    )
    return result


def _halt(state: FlightState) -> str | None:
    """Why the drone must be left alone now, or ``None``."""
    if state.stop_unconfirmed is not None:
        return (
            f"the stop was not confirmed ({state.stop_unconfirmed}): motors may turn; cut the drone's power"
        )
    return "somebody stopped the drone, not this flight; find out why" if state.locked else None


def _why_no_label(state: FlightState, error: PerchhwError) -> str:
    """What kept the record from telling how it ended."""
    return state.record_lost or state.link_lost or f"label: {error}"
