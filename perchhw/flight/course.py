"""Fly one test flight: a course from the library, under the same supervision as a landing attempt.

It needs no policy and nothing of our firmware on the drone: setpoints, poses and logs are those of any
Crazyflie.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from mocap_bridge.uri import parse_mocap_uri
from onboard.lab_file import LabFile
from onboard.lab_time import open_timebase
from onboard.link.uri import check_drone_uri
from onboard.manoeuvres import Course, manoeuvre
from onboard.outcome import Outcome
from onboard.record.folder import discard_if_empty
from onboard.room import RoomGeometry
from onboard.vehicle import load_vehicle
from perchhw.flight.course_commands import CourseCommands
from perchhw.flight.explain import explain, refusal_recorded
from perchhw.flight.loop import OnLook, OnPhase
from perchhw.flight.mission import LOWEST_HOVER
from perchhw.flight.readback import TEST_FLIGHT_SETTINGS
from perchhw.flight.recording import FlightRecorder, RecordListener
from perchhw.flight.session import SupervisedFlight
from perchhw.flight.telemetry import TEST_FLIGHT_BLOCKS
from perchhw.lab import FlightSetup, correction_of, flies_by_own_law, in_record, limits_of, require_lab
from perchhw.record import RunRecorder
from perchhw.supervisor import Mission, SafetyLimits

FLOWN = "flown"
"""Outcome of a test flight that came to its end."""


@dataclass(frozen=True, kw_only=True)
class CourseRequest:
    """One test flight.

    Attributes:
        kind: of the library (:data:`onboard.manoeuvres.MANOEUVRES`).
        parameters: of the kind, SI; what is left out has its usual value.
        folder: the run folder for the record: reserved and empty, or not there yet.
        drone, mocap: URIs.
        vehicle: name or path of the vehicle file.
        legs: leg design, or None for that of the vehicle.
        room: ceiling and flight volume.
        lab: the lab file: limits, start mark, correction of the poses; None: a simulated room.
        operator, note: who flies, and what is to be remembered of it; both are kept with the record.
    """

    kind: str
    folder: Path
    drone: str
    mocap: str
    vehicle: str
    legs: str | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    room: RoomGeometry = field(default_factory=RoomGeometry)
    lab: LabFile | None = None
    operator: str | None = None
    note: str | None = None

    @classmethod
    def of(cls, setup: FlightSetup, kind: str, parameters: Mapping[str, float], folder: Path) -> Self:
        """Who flies where is as in `setup`."""
        return cls(
            kind=kind,
            parameters=parameters,
            folder=folder,
            drone=setup.drone,
            mocap=setup.mocap,
            vehicle=setup.vehicle,
            legs=setup.legs,
            room=setup.room,
            lab=setup.lab,
        )

    def course(self) -> Course:
        """What is flown.

        Raises:
            CourseError: unknown kind, unusable parameters, or it does not fit the room.
        """
        return manoeuvre(self.kind).course(self.parameters, self.room)


@dataclass(frozen=True)
class CourseResult:
    """What came of a test flight.

    Attributes:
        aborted_by: rule, command or person that ended it early, or None.
        record: the run folder.
        interrupted: the operator interrupted it.
        diagnosis: what happened and why, as in ``run.json``, or None where the record does not tell.
    """

    aborted_by: str | None
    record: Path
    interrupted: bool
    diagnosis: dict[str, Any] | None = None


def fly_course(
    request: CourseRequest,
    *,
    limits: SafetyLimits | None = None,
    on_phase: OnPhase | None = None,
    on_look: OnLook | None = None,
    listener: RecordListener | None = None,
) -> CourseResult:
    """Check, arm, take off, fly the course, land on the floor, disarm; everything is recorded.

    Raises:
        PerchhwError: no link, or input that cannot be used; the record holds the reason when it was already
            open.
    """
    check_drone_uri(request.drone)
    parse_mocap_uri(request.mocap)
    require_lab(request.drone, request.mocap, request.lab)
    vehicle = load_vehicle(request.vehicle, request.legs)
    course = request.course()
    mission = Mission(
        policy_crc=0,
        start=course.start,
        hover_height=max(LOWEST_HOVER, course.start[2]),
        approach_duration=course.duration,
        test_flight=True,
    )
    design = None if vehicle.legs is None else vehicle.legs.design
    with (
        open_timebase("test flight", request.drone, request.mocap) as clock,
        RunRecorder(request.folder, _configuration(request, vehicle.name, design), clock) as recorder,
        FlightRecorder(recorder, listener) as record,
    ):
        flight = SupervisedFlight(
            drone=request.drone,
            mocap=request.mocap,
            mission=mission,
            limits=limits or limits_of(request.lab, request.room, request.drone),
            blocks=TEST_FLIGHT_BLOCKS,
            settings=TEST_FLIGHT_SETTINGS,
            commands=lambda link, events, _readback: CourseCommands(link, events, clock, course),
            record=record,
            clock=clock,
            on_phase=on_phase,
            on_look=on_look,
            correction=correction_of(request.lab),
            own_law=flies_by_own_law(request.lab, request.drone),
        )
        with refusal_recorded(record, clock, request.folder):
            flown = flight.run()
        aborted_by = flown.state.aborted_by
        record.close(
            outcome=FLOWN if aborted_by is None else Outcome.ABORTED,
            aborted_by=aborted_by,
            drone_clock_rate=flown.drone_clock_rate,
        )
    return CourseResult(aborted_by, request.folder, flown.interrupted, explain(request.folder))


def fly_uninterrupted(request: CourseRequest, **shown: Any) -> CourseResult:
    """As :func:`fly_course`, one of several flights; `shown`: what displays it.

    Raises:
        KeyboardInterrupt: the operator interrupted; the drone has landed.
        PerchhwError: likewise; a folder into which nothing was written is gone.
    """
    try:
        result = fly_course(request, **shown)
    finally:
        discard_if_empty(request.folder)
    if result.interrupted:
        raise KeyboardInterrupt
    return result


def _configuration(request: CourseRequest, vehicle: str, legs: str | None) -> dict[str, Any]:
    """What ``run.json`` says about the flight."""
    return {
        "flight": request.kind,
        "parameters": manoeuvre(request.kind).values(request.parameters),
        "drone": request.drone,
        "mocap": request.mocap,
        "vehicle": vehicle,
        "legs": legs,
        "ceiling_z": request.room.ceiling_z,
        "operator": request.operator,
        "note": request.note,
        **in_record(request.lab, request.room),
    }
