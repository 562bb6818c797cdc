"""What a calibration found, as the lab file and the operator get it."""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calibration.measurement import Estimate
from calibration.room.ceiling_plane import CeilingPlane
from calibration.room.errors import GeometryRefused
from calibration.room.marker_body import MarkerBody, joined_with_flight
from calibration.room.trigger_error import TriggerError, trigger_error
from onboard.lab_file import LATENCY, Ceiling, LabFile, SubjectToBody
from onboard.quantity import Quantity
from perchhw.hover_check.poses import flight_sensing, unreported_delay
from perchhw.record import read_run


@dataclass(frozen=True, kw_only=True)
class RoomFound:
    """What was found of a room.

    Attributes:
        markers: where the body sits in its subject.
        ceiling: the plane.
        latency: s from exposure to arrival.
        unreported: s of it that the source does not tell.
        trigger: what their uncertainties do to tau.
    """

    markers: MarkerBody
    ceiling: CeilingPlane
    latency: Estimate
    unreported: Estimate
    trigger: TriggerError

    def lab(self, before: LabFile, source: str) -> LabFile:
        """The lab file with what was found, `source` its provenance."""
        height, tilts = self.ceiling.height(), self.ceiling.tilts_deg()
        plane = Ceiling(height=Quantity(height[0], "m", height[1], source))
        simulated = before.clock is not None  # its ceiling is level, and nothing else may be said of it
        if not simulated or any(abs(tilt) > 3.0 * sigma for tilt, sigma in tilts):
            along_x, along_y = (Quantity(tilt, "deg", sigma, source) for tilt, sigma in tilts)
            plane = dataclasses.replace(plane, tilt_x_deg=along_x, tilt_y_deg=along_y)
        return dataclasses.replace(
            with_markers(before, self.markers, source),
            room=dataclasses.replace(before.room, ceiling=plane),
            mocap=dataclasses.replace(
                before.mocap,
                subject_to_body=_subject_to_body(self.markers, source),
                latency_s=Quantity(self.latency.value, "s", self.latency.sigma, source),
            ),
        )

    def json_shape(self) -> dict[str, Any]:
        """The JSON document; SI, angles in deg where they say so."""
        sigma = np.sqrt(np.diag(self.markers.position_covariance))
        turn = np.degrees(1.96 * np.sqrt(np.diag(self.markers.rotation_covariance)))
        tilts = self.ceiling.tilts_deg()
        return {
            "subject_to_body": {
                "position": [
                    Estimate(float(v), "m", float(s))
                    for v, s in zip(self.markers.position, sigma, strict=True)
                ],
                "quaternion": self.markers.rotation.as_quat().tolist(),
                "turn_u95_deg": turn.tolist(),
            },
            "plate_tilt_deg": self.markers.plate_tilt_deg,
            "ceiling": {
                "height": Estimate(self.ceiling.height()[0], "m", self.ceiling.height()[1]),
                "tilt_x_deg": Estimate(tilts[0][0], "deg", tilts[0][1]),
                "tilt_y_deg": Estimate(tilts[1][0], "deg", tilts[1][1]),
                "residuals_m": self.ceiling.residuals.tolist(),
            },
            "latency": self.latency,
            "latency_unreported": self.unreported,
            "trigger": self.trigger,
        }


def with_markers(lab: LabFile, markers: MarkerBody, source: str) -> LabFile:
    """The lab file whose poses are corrected by `markers`."""
    mocap = dataclasses.replace(lab.mocap, subject_to_body=_subject_to_body(markers, source))
    return dataclasses.replace(lab, mocap=mocap)


def room_found(
    rests: MarkerBody, ceiling: CeilingPlane, record: Path, speed: float, angle_deg: float
) -> RoomFound:
    """Everything together, with what the flight of `record` says.

    Args:
        rests: the correction that it was flown with.
        ceiling: the plane.
        record: its run folder.
        speed, angle_deg: of the approach whose trigger is told (m/s, deg).

    Raises:
        GeometryRefused: flight and rests contradict each other, or the latency is beyond what may be flown.
        RecordTooShort: the flight cannot be analysed.
    """
    found = flight_sensing(record)
    if found.acceleration is None:
        raise GeometryRefused(f"{record}: has no accelerometer in it; fly again, with a new --out")
    fit = found.acceleration
    markers = joined_with_flight(
        rests, fit.rotation, fit.rotation_covariance, fit.offset, fit.offset_covariance
    )
    pose = read_run(record).series["pose"]
    reported = float(np.nanmedian(pose.t - pose.numbers("capture_time")))
    unreported = unreported_delay(found)
    latency = dataclasses.replace(unreported, value=max(0.0, reported + unreported.value))
    if latency.value > LATENCY.most:
        most = 1e3 * LATENCY.most
        raise GeometryRefused(
            f"the poses are {1e3 * latency.value:.0f} ms old when they arrive, and {most:.0f} are "
            "the most that may be flown: use a cable, and let the computer of the motion capture do less"
        )
    below = math.sqrt(float(markers.position_covariance.diagonal().max()))
    trigger = trigger_error(speed, angle_deg, ceiling.height()[1], below, latency.sigma)
    return RoomFound(
        markers=markers, ceiling=ceiling, latency=latency, unreported=unreported, trigger=trigger
    )


def _subject_to_body(markers: MarkerBody, source: str) -> SubjectToBody:
    sigma = np.sqrt(np.diag(markers.position_covariance))
    x, y, z = (
        Quantity(float(value), "m", float(one), source)
        for value, one in zip(markers.position, sigma, strict=True)
    )
    qx, qy, qz, qw = markers.rotation.as_quat().tolist()
    return SubjectToBody(position=(x, y, z), quaternion=(qx, qy, qz, qw))
