"""A calibration from its first rest to what was found."""

from dataclasses import dataclass
from pathlib import Path

from calibration.bench.procedures.run_book import RunBook
from calibration.room.ceiling_plane import ceiling_plane
from calibration.room.marker_body import Standing, from_rests
from calibration.room.standing import HEIGHT_SIGMA, standing_height
from onboard.lab_file import LabFile
from onboard.link.exclusive import hold
from onboard.vehicle import load_vehicle
from perchhw.flight.turnaround import Confirm
from perchhw.lab.setup import FlightSetup, flight_setup
from perchhw.mocap_calibration.result import RoomFound, room_found, with_markers
from perchhw.mocap_calibration.steps import FLIGHT, RESTS, TOUCH_STEPS, Survey, forgotten_if_refused
from perchhw.screen.display import Display

WRITTEN = "written"
"""Step of the book after which a calibration is over."""


@dataclass(frozen=True, kw_only=True)
class CalibrationPlan:
    """What is measured with what.

    Attributes:
        lab: the lab file as it is.
        setup: drone and motion capture, of that file.
        wand: subject that touches the ceiling, and `marker_radius` of its marker, m.
        plate: height of the plate's top, m.
        rest_height: of the body's origin above it, m; None: by the vehicle file.
        within: s to wait for each step.
        speed, angle_deg: of the approach whose trigger is told of.
        source: provenance of what is written.
    """

    lab: LabFile
    setup: FlightSetup
    wand: str
    marker_radius: float
    plate: float
    rest_height: float | None
    within: float
    speed: float
    angle_deg: float
    source: str

    def settings(self) -> dict[str, str]:
        """What must be the same when a calibration goes on."""
        return {"lab": self.lab.file, "drone": self.setup.drone.partition("?")[0], "wand": self.wand}

    def standing(self) -> Standing:
        """How the drone stands on the plate."""
        height = self.rest_height
        if height is None:
            height = standing_height(load_vehicle(self.setup.vehicle, self.setup.legs))
        return Standing(height, HEIGHT_SIGMA, plate=self.plate)


def calibrate_room(
    plan: CalibrationPlan, book: RunBook, confirm: Confirm, display: Display
) -> tuple[RoomFound, Path]:
    """Go through the steps that the book does not have yet; gives what was found, and the flight's record.

    Raises:
        GeometryRefused: a step was not done in time, or what was measured does not tell what is sought; the
            book has forgotten the steps that it is about.
        CalibrationFlightEnded: a safety rule ended the flight.
    """
    survey = Survey(book, plan.setup, plan.wand, plan.within)
    with hold(plan.setup.drone):
        first, second, touches = survey.places()
        with forgotten_if_refused(book, *RESTS, FLIGHT):
            rests = from_rests(first, second, plan.standing())
        with forgotten_if_refused(book, *TOUCH_STEPS):
            ceiling = ceiling_plane(touches, plan.marker_radius)
        corrected = flight_setup(with_markers(plan.lab, rests, plan.source), drone=plan.setup.drone)
        record = survey.flight(corrected, book.folder, confirm, display)
    with forgotten_if_refused(book, *RESTS, FLIGHT):
        found = room_found(rests, ceiling, record, plan.speed, plan.angle_deg)
    return found, record
