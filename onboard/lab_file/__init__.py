"""The lab file (TOML, ``schema = "perchhw.lab/1"``): the room, its drones, its motion capture, its limits.

Described in docs/lab_file.md. Which limits there are is not known on this floor: the reader is told.
"""

from onboard.lab_file.addresses import DroneAddresses, drone_addresses
from onboard.lab_file.bounds import (
    CEILING_HEIGHT,
    CEILING_TILT,
    LATENCY,
    OFFSET,
    WALL,
    bounds_of,
    room_problem,
)
from onboard.lab_file.measured import put_measured
from onboard.lab_file.model import (
    LAB_FILE,
    SCHEMA,
    Ceiling,
    LabDrone,
    LabFile,
    LabFileError,
    LabMocap,
    LabRoom,
    StartMark,
    SubjectToBody,
    plain,
    split_subject,
    with_subject,
)
from onboard.lab_file.reader import parse_lab, read_lab_file
from onboard.lab_file.writer import lab_to_toml, write_lab_file

__all__ = [
    "CEILING_HEIGHT",
    "CEILING_TILT",
    "LAB_FILE",
    "LATENCY",
    "OFFSET",
    "SCHEMA",
    "WALL",
    "Ceiling",
    "DroneAddresses",
    "LabDrone",
    "LabFile",
    "LabFileError",
    "LabMocap",
    "LabRoom",
    "StartMark",
    "SubjectToBody",
    "bounds_of",
    "drone_addresses",
    "lab_to_toml",
    "parse_lab",
    "plain",
    "put_measured",
    "read_lab_file",
    "room_problem",
    "split_subject",
    "with_subject",
    "write_lab_file",
]
