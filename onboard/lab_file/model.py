"""What a lab file says, as typed values. URIs are opaque, but for the subject of the motion capture."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated
from urllib.parse import quote, unquote

from onboard.arrays import Quaternion, Vector
from onboard.errors import InputError, OnboardError
from onboard.lab_file.bounds import CEILING_HEIGHT, CEILING_TILT, FLOOR, HEADING, LATENCY, PLACE, WALL
from onboard.quantity import Quantity
from onboard.room import RoomGeometry

SCHEMA = "perchhw.lab/1"
LAB_FILE = Path("lab.toml")
"""The lab file of the working folder: the one that counts where none is given."""
PLAIN_SOURCE = "lab file"
"""Source of a quantity that is written as a plain number."""


class LabFileError(OnboardError, InputError):
    """A lab file that cannot be used. The message names file and key, and says what to do."""


def plain(value: float, unit: str) -> Quantity:
    """The quantity that a plain number in the schema's unit stands for."""
    return Quantity(float(value), unit, 0.0, PLAIN_SOURCE)


AT_ORIGIN, LEVEL, AT_ONCE = plain(0.0, "m"), plain(0.0, "deg"), plain(0.0, "s")


@dataclass(frozen=True, kw_only=True)
class Ceiling:
    """The ceiling as a plane.

    Attributes:
        height: above x = y = 0 of the world frame.
        tilt_x_deg, tilt_y_deg: angles at which it rises along +x and along +y.
    """

    height: Annotated[Quantity, CEILING_HEIGHT]
    tilt_x_deg: Annotated[Quantity, CEILING_TILT] = LEVEL
    tilt_y_deg: Annotated[Quantity, CEILING_TILT] = LEVEL


@dataclass(frozen=True, kw_only=True)
class StartMark:
    """Where a drone is put down, and which way its body's x axis then points (from the world's x axis)."""

    x: Annotated[Quantity, PLACE]
    y: Annotated[Quantity, PLACE]
    yaw_deg: Annotated[Quantity, HEADING] = LEVEL

    @property
    def pose(self) -> Vector:
        """x (m), y (m), yaw (rad)."""
        return self.x.value, self.y.value, math.radians(self.yaw_deg.value)


@dataclass(frozen=True, kw_only=True)
class LabRoom:
    """The room, in the world frame of the motion capture (ENU, z up).

    Attributes:
        floor: height of the floor.
        x_min, x_max, y_min, y_max: the walls of the volume that may be flown in.
        ceiling: what is landed on.
        start: start mark of drones that name none of their own.
    """

    x_min: Annotated[Quantity, WALL]
    x_max: Annotated[Quantity, WALL]
    y_min: Annotated[Quantity, WALL]
    y_max: Annotated[Quantity, WALL]
    ceiling: Ceiling
    start: StartMark
    floor: Annotated[Quantity, FLOOR] = AT_ORIGIN

    def geometry(self) -> RoomGeometry:
        """The room in SI numbers."""
        return RoomGeometry(
            ceiling_z=self.ceiling.height.value,
            x_min=self.x_min.value,
            x_max=self.x_max.value,
            y_min=self.y_min.value,
            y_max=self.y_max.value,
            floor_z=self.floor.value,
            ceiling_tilt_x=math.radians(self.ceiling.tilt_x_deg.value),
            ceiling_tilt_y=math.radians(self.ceiling.tilt_y_deg.value),
        )


@dataclass(frozen=True, kw_only=True)
class LabDrone:
    """One drone of the lab.

    Attributes:
        uri: its address.
        vehicle: vehicle file (relative to the lab file's folder) or name of a known vehicle.
        legs: leg design, or None for the vehicle's own.
        policy: policy file (relative to the lab file's folder) or name of a shipped one; None: the default.
        subject: its name in the motion capture, where it is not that of ``[mocap]``.
        start: its start mark, where it is not that of ``[room]``.
        own_law: our law flies take-off, hover and level-out too, which a drone leaves to its firmware's PID.
    """

    uri: str
    vehicle: str
    legs: str | None = None
    policy: str | None = None
    subject: str | None = None
    start: StartMark | None = None
    own_law: bool = False


@dataclass(frozen=True, kw_only=True)
class SubjectToBody:
    """Where the drone's body sits in the subject that the motion capture tracks.

    Attributes:
        position: origin of the body in the axes of the subject, m.
        quaternion: (x, y, z, w) of unit length, from the axes of the body (FLU) to those of the subject.
    """

    position: tuple[Quantity, Quantity, Quantity] = (AT_ORIGIN, AT_ORIGIN, AT_ORIGIN)
    quaternion: Quaternion = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class LabMocap:
    """The motion capture.

    Attributes:
        uri: its address, without a subject.
        subject: name of the body that is flown.
        subject_to_body: where the drone's body sits in the subject.
        latency_s: from exposure to arrival, as far as the source does not tell it with each pose.
    """

    uri: str
    subject: str
    subject_to_body: SubjectToBody = SubjectToBody()
    latency_s: Annotated[Quantity, LATENCY] = AT_ONCE


@dataclass(frozen=True, kw_only=True)
class LabFile:
    """A lab.

    Attributes:
        room, drones, mocap: the tables of the file.
        limits: safety limits that are not the usual ones, by name, in SI units.
        clock: ``HOST:PORT`` where a simulated lab says what time it is, and how it is; None: a real room.
        file: where it was read, for messages.
    """

    room: LabRoom
    drones: tuple[LabDrone, ...]
    mocap: LabMocap
    limits: Mapping[str, Quantity] = field(default_factory=dict)
    clock: str | None = None
    file: str = field(default="", compare=False)

    def drone(self, uri: str) -> LabDrone | None:
        """The drone with this very address, or None."""
        return next((drone for drone in self.drones if drone.uri == uri), None)

    def mocap_uri(self, drone: LabDrone | None) -> str:
        """Address of the poses of `drone`; None: of the subject of ``[mocap]``."""
        own = None if drone is None else drone.subject
        return with_subject(self.mocap.uri, own or self.mocap.subject)

    def beside(self, name: str) -> str:
        """`name` as a path when it is a file relative to the lab file's folder, else as it is."""
        path = Path(self.file).parent / name
        return str(path) if path.is_file() else name

    def start(self, drone: LabDrone | None) -> StartMark:
        """Start mark of `drone`; None: that of the room."""
        own = None if drone is None else drone.start
        return own or self.room.start


def split_subject(uri: str) -> tuple[str, str | None]:
    """A motion-capture URI without its ``subject=NAME``, and NAME (None: it has none)."""
    address, _, query = uri.partition("?")
    options = [option for option in query.split("&") if option]
    names = [unquote(option.partition("=")[2]) for option in options if option.startswith("subject=")]
    others = [option for option in options if not option.startswith("subject=")]
    return "?".join([address, *(["&".join(others)] if others else [])]), names[0] if names else None


def with_subject(uri: str, subject: str) -> str:
    """A motion-capture URI that asks for `subject`, before anything else."""
    address, _, others = split_subject(uri)[0].partition("?")
    return f"{address}?{'&'.join([f'subject={quote(subject)}', *([others] if others else [])])}"
