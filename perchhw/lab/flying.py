"""What a flight takes from its lab file: safety limits, the start mark, the correction of poses."""

import dataclasses
from typing import Any

from mocap_bridge.correction import AS_TRACKED, PoseCorrection
from onboard.lab_file import LabFile
from onboard.room import RoomGeometry
from onboard.vehicle.schema import Measured, Range
from perchhw.supervisor import SafetyLimits

_POSITIVE = {
    "s": ("link_silence", "pose_age", "pose_age_bridged", "telemetry_age", "battery_age"),
    "V": ("battery_at_rest", "battery_in_flight"),
    "m": ("disagreement_on_ground", "disagreement_in_flight", "height_on_ground", "start_mark_distance"),
    "m/s": ("speed_on_ground",),
    "rad": (
        "yaw_disagreement",
        "tilt_on_ground",
        "tilt_in_hover",
        "tilt_in_test_flight",
        "start_mark_heading",
    ),
}

LIMITS: dict[str, Measured] = {
    name: Measured(unit, Range.POSITIVE) for unit, names in _POSITIVE.items() for name in names
} | {"wall_margin": Measured("m", Range.NON_NEGATIVE)}
"""What ``[limits]`` may hold: the numbers of :class:`perchhw.supervisor.SafetyLimits`, with their units."""


def limits_of(lab: LabFile | None, room: RoomGeometry, drone: str) -> SafetyLimits:
    """The safety limits of a flight of `drone` in `room`: the usual ones where there is no lab file."""
    if lab is None:
        return SafetyLimits(room=room)
    given: dict[str, Any] = {name: quantity.value for name, quantity in lab.limits.items()}
    return SafetyLimits(room=room, start_mark=lab.start(lab.drone(drone)).pose, **given)


def correction_of(lab: LabFile | None) -> PoseCorrection:
    """What is done to the poses of the lab's motion capture before anything else sees them."""
    if lab is None:
        return AS_TRACKED
    x, y, z = (part.value for part in lab.mocap.subject_to_body.position)
    return PoseCorrection(
        position=(x, y, z),
        quaternion=lab.mocap.subject_to_body.quaternion,
        latency=lab.mocap.latency_s.value,
    )


def in_record(lab: LabFile | None, room: RoomGeometry) -> dict[str, Any]:
    """What ``run.json`` says about the place of a flight."""
    return {
        "room": dataclasses.asdict(room),
        "lab": None if lab is None else lab.file,
        "limits": {} if lab is None else {name: quantity.value for name, quantity in lab.limits.items()},
        "pose_correction": dataclasses.asdict(correction_of(lab)),
    }
