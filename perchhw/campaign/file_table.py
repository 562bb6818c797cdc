"""Reading a campaign file: each complaint names the file and the key, and what would be right."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from onboard.errors import InputError
from onboard.lab_file import LabFile
from onboard.room import RoomGeometry
from onboard.schema import schema_problem
from onboard.unit_slip import unit_hint
from perchhw.attempt import APPROACH_PARAMETERS
from perchhw.errors import FlightStackError
from perchhw.lab import FlightSetup, SetupError, flight_setup

SCHEMA = "perchhw.campaign/1"
ROOM_KEYS = ("ceiling_z", "x_min", "x_max", "y_min", "y_max")

MOST_VALUES = 1000
"""Of a range; one more is a slip of its step."""


class CampaignFileError(FlightStackError, InputError):
    """A campaign file cannot be used; the message names file and key, and what would be right."""


class FileTable:
    """One table of the file while it is being read: remembers which keys were read, for unknown ones."""

    def __init__(self, path: Path, name: str, content: dict[str, Any]) -> None:
        self._path, self._name, self.content = path, name, content
        self._read: list[str] = []

    def error(self, key: str, problem: str) -> CampaignFileError:
        """What is wrong with a key, as an error to raise."""
        return CampaignFileError(f"{self._path}: key {self._full(key)}: {problem}")

    def _full(self, key: str) -> str:
        return f"{self._name}.{key}" if self._name else key

    def _get(self, key: str, kind: type | tuple[type, ...], expected: str, default: Any = None) -> Any:
        self._read.append(key)
        if key not in self.content:
            if default is None:
                raise self.error(key, f"missing; expected {expected}")
            return default
        value = self.content[key]
        if not isinstance(value, kind) or isinstance(value, bool):
            raise self.error(key, f"{value!r} is not {expected}")
        return value

    def table(self, key: str, required: bool = True) -> "FileTable":
        """The table under a key; an empty one where it may be absent."""
        content = self._get(key, dict, "a table", None if required else {})
        return FileTable(self._path, self._full(key), content)

    def tables(self, key: str) -> list["FileTable"]:
        """An array of tables, at least one."""
        rows = self._get(key, list, "an array of tables")
        if not rows or not all(isinstance(row, dict) for row in rows):
            raise self.error(key, f"{rows!r} is not an array of tables: write each under [[{key}]]")
        return [FileTable(self._path, f"{self._full(key)}[{i}]", row) for i, row in enumerate(rows)]

    def optional_text(self, key: str) -> str | None:
        """A text that another file may give instead; None when it is left out."""
        self._read.append(key)
        return self.text(key) if key in self.content else None

    def text(self, key: str, default: str | None = None) -> str:
        """A text; required without a default."""
        return str(self._get(key, str, "a text", default))

    def choice(self, key: str, choices: Sequence[str], default: str | None = None) -> str:
        """One of several texts."""
        value = self.text(key, default)
        if value not in choices:
            raise self.error(key, f"{value!r} is not one of {', '.join(choices)}")
        return value

    def schema(self, wanted: str) -> None:
        """Refuse a file of another kind or version."""
        self._read.append("schema")
        problem = schema_problem(self.content.get("schema"), wanted)
        if problem is not None:
            raise self.error("schema", problem)

    def integer(self, key: str, default: int, minimum: int) -> int:
        """A whole number from `minimum` on."""
        value = self._get(key, int, "a whole number", default)
        if value < minimum:
            raise self.error(key, f"{value} is less than {minimum}")
        return int(value)

    def number(self, key: str, default: float) -> float:
        """A finite number."""
        value = float(self._get(key, (int, float), "a number", default))
        if not math.isfinite(value):
            raise self.error(key, f"{value} is not finite")
        return value

    def at_least(self, key: str, default: float, minimum: float) -> float:
        """A finite number from `minimum` on."""
        value = self.number(key, default)
        if value < minimum:
            raise self.error(key, f"{value:g} is less than {minimum:g}")
        return value

    def numbers(self, key: str, fits: Callable[[float], bool], expected: str, unit: str) -> tuple[float, ...]:
        """A list of numbers in `unit`, or a range of them ``"first:last:step"`` (both ends included)."""
        given = self._get(key, (list, str), f"a list or first:last:step of {expected}")
        values = self._range(key, given) if isinstance(given, str) else given
        if not values:
            raise self.error(key, f"empty; expected {expected}")
        for value in values:
            if not isinstance(value, int | float) or isinstance(value, bool):
                raise self.error(key, f"{value!r} is not among {expected}")
            if not fits(float(value)):
                hint = unit_hint(float(value), unit, fits)
                raise self.error(key, f"{value!r} is not among {expected}{hint}")
        if len(set(values)) != len(values):
            raise self.error(key, "a value stands twice; use grid.repeats for repeats")
        return tuple(sorted(float(v) for v in values))

    def _range(self, key: str, text: str) -> list[float]:
        try:
            first, last, step = (float(part) for part in text.split(":"))
        except ValueError:
            raise self.error(key, f"{text!r} is not a range first:last:step") from None
        if not (step > 0.0 and last >= first and math.isfinite(last)):
            raise self.error(key, f"{text!r} needs first <= last and a step above 0")
        count = math.floor((last - first) / step + 1e-9) + 1
        if count > MOST_VALUES:
            raise self.error(key, f"{text!r} are {count} values, more than {MOST_VALUES}: is the step right?")
        return [round(first + i * step, 9) for i in range(count)]

    def refuse_unread(self) -> None:
        """Complain about a key that nobody asked for."""
        unknown = [key for key in self.content if key not in self._read]
        if unknown:
            known = ", ".join(
                sorted(set(self._read) | (set(APPROACH_PARAMETERS) if self._name == "approach" else set()))
            )
            raise self.error(unknown[0], f"unknown; known are {known}")


def room_of(table: FileTable, given: RoomGeometry) -> RoomGeometry:
    """The ``[room]`` table; what is left out is as `given`: by the lab file, or the simulated room."""
    values = {key: table.number(key, getattr(given, key)) for key in ROOM_KEYS}
    table.refuse_unread()
    if not (values["x_min"] < values["x_max"] and values["y_min"] < values["y_max"]):
        raise table.error("x_min", "the flight volume is empty: x_min < x_max and y_min < y_max are needed")
    room = dataclasses.replace(given, **values)
    if room.lowest_ceiling <= room.floor_z:
        raise table.error("ceiling_z", f"{room.ceiling_z:g} is not a height above the floor")
    return room


def setup_of(
    root: FileTable, lab: LabFile | None, policy: str | None = None, drone: str | None = None
) -> FlightSetup:
    """Who flies where, as the file says, completed from the lab file; the room is that of the latter. `drone`
    flies instead of the file's.

    Raises:
        CampaignFileError: neither of the two says it.
    """
    named = root.optional_text("drone")
    try:
        return flight_setup(
            lab,
            drone=drone or named,
            mocap=root.optional_text("mocap"),
            vehicle=root.optional_text("vehicle"),
            legs=root.optional_text("legs"),
            policy=policy,
        )
    except SetupError as error:
        raise root.error(error.key, error.message) from error


def check_names(root: FileTable, checks: Mapping[str, Callable[[], object]]) -> None:
    """What a file names must be usable before the first flight; nothing is connected.

    Args:
        root: the file.
        checks: by key; each raises InputError when its value cannot be used.

    Raises:
        CampaignFileError: one cannot.
    """
    for key, check in checks.items():
        try:
            check()
        except InputError as error:
            raise root.error(key, str(error)) from error
