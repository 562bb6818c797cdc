"""The checks of the last days: a file each, in a folder of the drone beside the records."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from onboard.errors import InputError
from onboard.json_file import parsed, write_json_atomically
from onboard.lab_file import split_subject
from onboard.record.folder import make_folder, slug
from onboard.schema import schema_problem
from onboard.vehicle import Vehicle, vehicle_to_toml
from perchhw.errors import FlightStackError
from perchhw.hover_check.judge import CheckedQuantity, LineVerdict
from perchhw.lab.hardware import on_this_machine

SCHEMA = "perchhw.hover_check/1"
FOLDER = "hover-checks"
LAST = 20
"""Checks that are looked back on."""


class HistoryError(FlightStackError, InputError):
    """A check of an earlier day that cannot be read; the message names the file."""


@dataclass(frozen=True)
class EarlierCheck:
    """One check of an earlier time: when (UTC, ISO 8601), and its values by quantity, SI."""

    when: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class History:
    """The checks of one drone as one vehicle: what the vehicle file says anew is held anew.

    Attributes:
        folder: where they are.
        vehicle_crc: CRC-32 of all that the vehicle file says.
    """

    folder: Path
    vehicle_crc: int

    @classmethod
    def of(cls, out: Path, drone: str, mocap: str, vehicle: Vehicle) -> "History":
        """Of the drone with this address, beside the records in `out`.

        A simulated drone has another port in each lab: it is known by the subject of its poses.
        """
        name = drone.partition("?")[0]  # what follows is the clock of a simulated lab
        if on_this_machine(drone):
            name = f"simulated-{split_subject(mocap)[1] or name}"
        return cls(out / FOLDER / slug(name), zlib.crc32(vehicle_to_toml(vehicle).encode()))

    def before(self) -> tuple[EarlierCheck, ...]:
        """The last checks that found nothing changed, on a computer that was not too busy; oldest first, from
        the newest beginning on.

        Raises:
            HistoryError: a file is damaged.
        """
        kept: list[EarlierCheck] = []
        for path in sorted(self.folder.glob("*.json")):
            document = _read(path)
            if document["vehicle_crc32"] != self.vehicle_crc:
                continue
            if document["begins_anew"]:
                kept.clear()
            if not document["changed"] and document["busy"] is None:
                kept.append(EarlierCheck(document["when"], document["values"]))
        return tuple(kept[-LAST:])

    def keep(
        self,
        when: datetime,
        record: Path,
        lines: Sequence[CheckedQuantity],
        *,
        begins_anew: bool,
        busy: str | None,
    ) -> Path:
        """Write today's check.

        Raises:
            OutputFolderError: the folder cannot be made or written.
        """
        make_folder(self.folder)
        path = self.folder / f"{when:%Y%m%dT%H%M%S.%fZ}.json"
        changed = [line.held.what for line in lines if line.verdict is LineVerdict.CHANGED]
        write_json_atomically(
            path,
            {
                "schema": SCHEMA,
                "when": when.isoformat(timespec="seconds"),
                "vehicle_crc32": self.vehicle_crc,
                "record": str(record),
                "begins_anew": begins_anew,
                "busy": busy,
                "changed": [] if begins_anew else changed,
                "values": {line.held.what: line.measured.value for line in lines},
            },
        )
        return path


def _read(path: Path) -> dict[str, Any]:
    try:
        document = parsed(path.read_text(encoding="utf-8"))
        problem = schema_problem(document.get("schema"), SCHEMA)
        if problem is not None:
            raise ValueError(f"schema {problem}")
        values = {str(key): float(value) for key, value in document["values"].items()}
        return {
            "when": str(document["when"]),
            "vehicle_crc32": int(document["vehicle_crc32"]),
            "begins_anew": bool(document["begins_anew"]),
            "busy": document.get("busy"),  # not there in checks of before it was asked
            "changed": list(document["changed"]),
            "values": values,
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise HistoryError(
            f"{path}: is no check that can be read ({error}); remove it, and its day does not count"
        ) from error
