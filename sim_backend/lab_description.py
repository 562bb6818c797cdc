"""The lab file of a simulated lab: there while the lab serves, gone with it, or with the next one's start."""

import math
from collections.abc import Sequence
from pathlib import Path

from onboard.errors import InputError
from onboard.held_folder import HeldFolder, new_held_folder, take_away_left
from onboard.lab_file import (
    LAB_FILE,
    Ceiling,
    LabDrone,
    LabFile,
    LabMocap,
    LabRoom,
    StartMark,
    plain,
    split_subject,
    write_lab_file,
)
from onboard.room import RoomGeometry
from sim_backend.errors import SimulationError
from sim_backend.room.settings import RoomSettings
from sim_backend.world import start_marks

COMMENT = "Written by `perchhw sim lab`, which takes it away when it ends: copy what is to be kept."

_FOLDER = "perchhw-simulated-lab-"
"""How names of the temporary folders begin; those of earlier versions, without locks, began otherwise."""


class LabFileTakenError(SimulationError, InputError):
    """Where the lab file is to be there is one already, which may be that of a real room."""


class LabDescription:
    """Writes the lab file of a simulated lab and removes it again.

    Args:
        chosen: where it is to be; None makes a temporary folder for it.

    Attributes:
        path: of the lab file, from :meth:`write` on.
    """

    def __init__(self, chosen: Path | None) -> None:
        self._chosen = chosen
        self._folder: HeldFolder | None = None
        self.path: Path | None = None

    def require_free(self) -> None:
        """Refuse the chosen place where something is: before a lab is prepared for it.

        Raises:
            LabFileTakenError: there is a file.
        """
        if self._chosen is not None and self._chosen.exists():
            raise LabFileTakenError(
                f"{self._chosen.absolute()}: exists and is not overwritten; remove it or choose another place"
            )

    def write(self, lab: LabFile) -> Path:
        """Write the file and give its absolute path.

        Raises:
            LabFileTakenError: as :meth:`require_free`; the file may have come since.
            LabFileError: it cannot be written.
        """
        if self._chosen is None:
            take_away_left(_FOLDER)
            self._folder = new_held_folder(_FOLDER)
            path = self._folder.path / LAB_FILE
        else:
            self.require_free()
            path = self._chosen.absolute()
        write_lab_file(path, lab, COMMENT)
        self.path = path
        return path

    def remove(self) -> None:
        """Remove what was written; further calls do nothing."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)
            self.path = None
        if self._folder is not None:
            self._folder.let_go()
            self._folder = None


def describe(
    drones: Sequence[str], mocap: str, vehicle: str, legs: str | None, room: RoomGeometry | None = None
) -> LabFile:
    """A simulated lab as a lab file says it.

    Args:
        drones: addresses, cf1 first.
        mocap: address of the poses of any of them.
        vehicle, legs: what they are.
        room: None for the one that is simulated by default.
    """
    room = room or RoomGeometry()
    marks = [
        StartMark(x=plain(mark.x, "m"), y=plain(mark.y, "m"), yaw_deg=plain(math.degrees(mark.yaw), "deg"))
        for mark in start_marks(len(drones))
    ]
    file = Path(vehicle)
    return LabFile(
        room=LabRoom(
            floor=plain(room.floor_z, "m"),
            x_min=plain(room.x_min, "m"),
            x_max=plain(room.x_max, "m"),
            y_min=plain(room.y_min, "m"),
            y_max=plain(room.y_max, "m"),
            ceiling=Ceiling(height=plain(room.ceiling_z, "m")),
            start=marks[0],
        ),
        drones=tuple(
            LabDrone(
                uri=uri,
                vehicle=str(file.absolute()) if file.is_file() else vehicle,
                legs=legs,
                subject=f"cf{number}",
                start=mark,
            )
            for number, (uri, mark) in enumerate(zip(drones, marks, strict=True), start=1)
        ),
        mocap=LabMocap(
            uri=split_subject(mocap)[0],
            subject="cf1",
            latency_s=plain(RoomSettings().latency, "s"),
        ),
    )
