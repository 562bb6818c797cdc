"""Reading a campaign file: each complaint names the file and the key, and what would be right; all of them
are told at once.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from mocap_bridge.uri import parse_mocap_uri
from onboard.errors import InputError
from onboard.lab_file import LabFile
from onboard.link import check_drone_uri
from onboard.room import RoomGeometry
from onboard.schema import schema_problem
from onboard.unit_slip import unit_hint
from onboard.vehicle import load_vehicle, vehicle_to_toml
from onboard.vehicle.fingerprint import fingerprint
from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE
from perchhw.errors import FlightStackError
from perchhw.lab import FlightSetup, SetupError, flight_setup

SCHEMA = "perchhw.campaign/1"
ROOM_KEYS = ("ceiling_z", "x_min", "x_max", "y_min", "y_max")

_WHO = ("drone", "mocap", "vehicle", "legs", "policy")

MOST_VALUES = 1000
"""Of a range; one more is a slip of its step."""
MOST_SHOWN = 4
"""Values of a key that are named one by one when they do not fit."""

_T = TypeVar("_T", str, int, dict[str, Any])


class CampaignFileError(FlightStackError, InputError):
    """A campaign file cannot be used; the message names file and key, and what would be right."""


class FileTable:
    """One table of the file while it is being read. What is wrong is noted, and something stands in for it
    until :meth:`settle`; which keys were read is remembered, for unknown ones.

    Attributes:
        content: as it stands in the file.
        sound: nothing of this table itself is wrong so far.
    """

    def __init__(
        self, path: Path, name: str, content: dict[str, Any], complaints: list[str] | None = None
    ) -> None:
        self._path, self._name, self.content = path, name, content
        self._read: list[str] = []
        self._complaints = [] if complaints is None else complaints
        self.sound = True

    def complain(self, key: str, problem: str) -> None:
        """Note what is wrong with a key."""
        self.sound = False
        complaint = f"{self._path}: key {self._full(key)}: {problem}"
        if complaint not in self._complaints:
            self._complaints.append(complaint)

    def settle(self) -> None:
        """End of the reading, of whichever table of the file.

        Raises:
            CampaignFileError: with all that is wrong, a line each.
        """
        if self._complaints:
            raise CampaignFileError("\n".join(self._complaints))

    def _full(self, key: str) -> str:
        return f"{self._name}.{key}" if self._name else key

    def _get(self, key: str, kind: type[_T], expected: str, default: _T | None) -> _T:
        """The value; the default, or an empty one, where there is none or it is of another kind."""
        self._read.append(key)
        value = self.content.get(key)
        if key not in self.content:
            if default is None:
                self.complain(key, f"missing; expected {expected}")
        elif isinstance(value, kind) and not isinstance(value, bool):
            return value
        else:
            self.complain(key, f"{value!r} is not {expected}")
        return kind() if default is None else default

    def table(self, key: str, required: bool = True) -> "FileTable":
        """The table under a key; an empty one where it may be absent."""
        told = len(self._complaints)
        content = self._get(key, dict, "a table", None if required else {})
        unread = len(self._complaints) > told  # what such a table then lacks is no news
        return FileTable(self._path, self._full(key), content, [] if unread else self._complaints)

    def tables(self, key: str) -> list["FileTable"]:
        """An array of tables, at least one; empty where it is none."""
        self._read.append(key)
        rows = self.content.get(key)
        if not (isinstance(rows, list) and rows and all(isinstance(row, dict) for row in rows)):
            self.complain(key, f"{rows!r} is not an array of tables: write each under [[{key}]]")
            return []
        return [
            FileTable(self._path, f"{self._full(key)}[{i}]", row, self._complaints)
            for i, row in enumerate(rows)
        ]

    def optional_text(self, key: str) -> str | None:
        """A text that another file may give instead; None when it is left out."""
        self._read.append(key)
        return self.text(key) if key in self.content else None

    def text(self, key: str, default: str | None = None) -> str:
        """A text; required without a default."""
        return self._get(key, str, "a text", default)

    def choice(self, key: str, choices: Sequence[str], default: str | None = None) -> str:
        """One of several texts."""
        value = self.text(key, default)
        if value not in choices:
            if isinstance(self.content.get(key), str):
                self.complain(key, f"{value!r} is not one of {', '.join(choices)}")
            return choices[0]
        return value

    def schema(self, wanted: str) -> None:
        """Refuse a file of another kind or version, at once: its keys may be others.

        Raises:
            CampaignFileError: it is of another.
        """
        self._read.append("schema")
        problem = schema_problem(self.content.get("schema"), wanted)
        if problem is not None:
            self.complain("schema", problem)
            self.settle()

    def integer(self, key: str, default: int, minimum: int) -> int:
        """A whole number from `minimum` on."""
        value = self._get(key, int, "a whole number", default)
        if value < minimum:
            self.complain(key, f"{value} is less than {minimum}")
            return default
        return value

    def number(self, key: str, default: float) -> float:
        """A finite number."""
        self._read.append(key)
        value = _as_float(given := self.content.get(key, default))
        if value is None:
            self.complain(key, f"{given!r} is not a number")
            return default
        if not math.isfinite(value):
            self.complain(key, f"{value} is not finite")
            return default
        return value

    def at_least(self, key: str, default: float, minimum: float) -> float:
        """A finite number from `minimum` on."""
        value = self.number(key, default)
        if value < minimum:
            self.complain(key, f"{value:g} is less than {minimum:g}")
            return default
        return value

    def numbers(self, key: str, fits: Callable[[float], bool], expected: str, unit: str) -> tuple[float, ...]:
        """A list of numbers in `unit`, or a range of them ``"first:last:step"`` (both ends included);
        empty where one does not fit.
        """
        self._read.append(key)
        given = self.content.get(key)
        if key not in self.content:
            self.complain(key, f"missing; expected a list or first:last:step of {expected}")
        elif isinstance(given, str):
            return self._fitting(key, self._range(key, given), fits, expected, unit)
        elif not isinstance(given, list):
            self.complain(key, f"{given!r} is not a list or first:last:step of {expected}")
        elif not given:
            self.complain(key, f"empty; expected {expected}")
        else:
            return self._fitting(key, given, fits, expected, unit)
        return ()

    def _fitting(
        self, key: str, values: Sequence[Any], fits: Callable[[float], bool], expected: str, unit: str
    ) -> tuple[float, ...]:
        wrong = [value for value in values if (number := _as_float(value)) is None or not fits(number)]
        if wrong:
            first = _as_float(wrong[0])
            hint = "" if first is None else unit_hint(first, unit, fits)
            shown = ", ".join(repr(value) for value in wrong[:MOST_SHOWN])
            more = f" and {len(wrong) - MOST_SHOWN} more" if len(wrong) > MOST_SHOWN else ""
            self.complain(
                key, f"{shown}{more} {'is' if len(wrong) == 1 else 'are'} not among {expected}{hint}"
            )
            return ()
        if len(set(values)) != len(values):
            self.complain(key, "a value stands twice; use grid.repeats for repeats")
        return tuple(sorted(float(v) for v in values))

    def _range(self, key: str, text: str) -> list[float]:
        try:
            first, last, step = (float(part) for part in text.split(":"))
        except ValueError:
            self.complain(key, f"{text!r} is not a range first:last:step")
            return []
        if not (step > 0.0 and last >= first and math.isfinite(last)):
            self.complain(key, f"{text!r} needs first <= last and a step above 0")
            return []
        count = math.floor((last - first) / step + 1e-9) + 1
        if count > MOST_VALUES:
            self.complain(key, f"{text!r} are {count} values, more than {MOST_VALUES}: is the step right?")
            return []
        return [round(first + i * step, 9) for i in range(count)]

    def refuse_unread(self, further: Sequence[str] = ()) -> None:
        """Complain about every key that nobody asked for; `further` keys could have been."""
        known = ", ".join(sorted({*self._read, *further}))
        for key in self.content:
            if key not in self._read:
                self.complain(key, f"unknown; known are {known}")


def _as_float(value: Any) -> float | None:
    """A number of the file; infinite where it has too many digits, None for what is no number."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf


def room_of(table: FileTable, given: RoomGeometry) -> RoomGeometry:
    """The ``[room]`` table; what is left out is as `given`: by the lab file, or the simulated room."""
    values = {key: table.number(key, getattr(given, key)) for key in ROOM_KEYS}
    table.refuse_unread()
    if not table.sound:
        return given
    if not (values["x_min"] < values["x_max"] and values["y_min"] < values["y_max"]):
        table.complain("x_min", "the flight volume is empty: x_min < x_max and y_min < y_max are needed")
    room = dataclasses.replace(given, **values)
    if room.lowest_ceiling <= room.floor_z:
        table.complain("ceiling_z", f"{room.ceiling_z:g} is not a height above the floor")
    return room


def setup_of(
    root: FileTable, lab: LabFile | None, policy: str | None = None, drone: str | None = None
) -> FlightSetup | None:
    """Who flies where, as the file says, completed from the lab file; the room is that of the latter. `drone`
    flies instead of the file's. None where neither of the two says it, which is noted.
    """
    named, mocap = root.optional_text("drone"), root.optional_text("mocap")
    check_addresses(root, drone or named, mocap)
    return completed(root, lab, drone or named, mocap, policy)


def nobody(root: FileTable) -> FlightSetup:
    """Stands in for who flies where the file does not say it; with what it says of vehicle and policy."""
    vehicle, legs, policy = (
        value if isinstance(value := root.content.get(key), str) else None
        for key in ("vehicle", "legs", "policy")
    )
    return FlightSetup(
        drone="",
        mocap="",
        vehicle=vehicle or DEFAULT_VEHICLE,
        legs=legs,
        policy=policy or DEFAULT_POLICY,
        room=RoomGeometry(),
        lab=None,
    )


def completed(
    root: FileTable, lab: LabFile | None, drone: str | None, mocap: str | None, policy: str | None
) -> FlightSetup | None:
    """As :func:`setup_of`, of a drone with these addresses."""
    vehicle, legs = root.optional_text("vehicle"), root.optional_text("legs")
    if not all(isinstance(root.content.get(key, ""), str) for key in _WHO):
        return None
    try:
        return flight_setup(lab, drone=drone, mocap=mocap, vehicle=vehicle, legs=legs, policy=policy)
    except SetupError as error:
        root.complain(error.key, error.message)
        return None


def check_names(root: FileTable, checks: Mapping[str, Callable[[], object]]) -> None:
    """What a file names must be usable before the first flight; nothing is connected.

    Args:
        root: the file; told what is not.
        checks: by key; each raises InputError when its value cannot be used.
    """
    for key, check in checks.items():
        try:
            check()
        except InputError as error:
            root.complain(key, str(error))


def check_addresses(table: FileTable, drone: str | None, mocap: str | None, drone_key: str = "drone") -> None:
    """Those that are given must be of a kind that is known; nothing is connected."""
    if drone:
        check_names(table, {drone_key: lambda: check_drone_uri(drone)})
    if mocap:
        check_names(table, {"mocap": lambda: parse_mocap_uri(mocap)})


def vehicle_sha256(vehicle: str, legs: str | None) -> str:
    """Of the numbers of a vehicle, which labels go by: its file may be written anew during a campaign."""
    return fingerprint(vehicle_to_toml(load_vehicle(vehicle, legs)))


def check_vehicle(root: FileTable, setup: FlightSetup) -> None:
    """Its vehicle must exist, and have these legs."""
    told = root.sound
    check_names(root, {"vehicle": lambda: load_vehicle(setup.vehicle)})
    if setup.legs is not None and root.sound == told:
        check_names(root, {"legs": lambda: load_vehicle(setup.vehicle, setup.legs)})
