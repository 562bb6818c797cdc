"""What a flight takes from its lab file: safety limits, the start mark, the correction of poses."""

import dataclasses
from typing import Any

from mocap_bridge.correction import AS_TRACKED, PoseCorrection
from onboard.bounds import Bounds
from onboard.lab_file import LabFile
from onboard.room import RoomGeometry
from perchhw.supervisor import SafetyLimits, allowed_limits

LIMITS: dict[str, Bounds] = {name: allowed.bounds for name, allowed in allowed_limits().items()}
"""What ``[limits]`` may hold: the numbers of :class:`perchhw.supervisor.SafetyLimits`, with their bounds."""


def limits_of(lab: LabFile | None, room: RoomGeometry, drone: str) -> SafetyLimits:
    """The safety limits of a flight of `drone` in `room`: the usual ones where there is no lab file."""
    if lab is None:
        return SafetyLimits(room=room)
    given: dict[str, Any] = {name: quantity.value for name, quantity in lab.limits.items()}
    return SafetyLimits(room=room, start_mark=lab.start(lab.drone(drone)).pose, **given)


def flies_by_own_law(lab: LabFile | None, drone: str) -> bool:
    """Whether `drone` is told to leave nothing to its firmware's PID."""
    known = None if lab is None else lab.drone(drone)
    return known is not None and known.own_law


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
