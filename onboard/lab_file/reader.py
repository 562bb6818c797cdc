"""Reading a lab file with full checks; every problem names file and key and says what to do."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from onboard.arrays import Quaternion
from onboard.bounds import Bounds
from onboard.lab_file.bounds import CEILING_TILT, NARROWEST, OFFSET, bounds_of
from onboard.lab_file.model import (
    PLAIN_SOURCE,
    SCHEMA,
    Ceiling,
    LabDrone,
    LabFile,
    LabFileError,
    LabMocap,
    LabRoom,
    StartMark,
    SubjectToBody,
    split_subject,
)
from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.schema import schema_problem
from onboard.toml_file import read_toml
from onboard.vehicle.schema import (
    Measured,
    Problems,
    Range,
    SectionT,
    as_table,
    as_text,
    check_keys,
    finite,
    parse_quantity,
)

_TABLES = ("schema", "clock", "room", "drones", "mocap", "limits")
_DRONE_KEYS = ("uri", "vehicle", "legs", "policy", "subject", "start", "own_law")
_NORM_TOLERANCE = 1e-3


def read_lab_file(path: Path, limits: Mapping[str, Bounds]) -> LabFile:
    """Read and check a lab file.

    Args:
        path: the file.
        limits: the limits that ``[limits]`` may name, with their units and bounds.

    Raises:
        LabFileError: with every problem found, one a line.
    """
    return parse_lab(read_toml(path, LabFileError), str(path), limits)


def parse_lab(content: Mapping[str, object], file: str, limits: Mapping[str, Bounds]) -> LabFile:
    """A lab from the content of its file; `file` is the name used in messages.

    Raises:
        LabFileError: with every problem found, one a line.
    """
    problems = Problems(file, LabFileError)
    problem = schema_problem(content.get("schema"), SCHEMA)
    if problem is not None:
        problems.add("schema", problem)
        problems.raise_any()
    check_keys(content, "", _TABLES, problems)
    room = _room(content.get("room"), problems)
    drones = _drones(content.get("drones"), problems)
    mocap = _mocap(content.get("mocap"), problems)
    given = _limits(content.get("limits", {}), limits, problems)
    clock = as_text(content.get("clock"), "clock", problems, required=False)
    if room is not None:
        _check_room(room, drones, problems, simulated=clock is not None)
    problems.raise_any()
    if room is None or mocap is None:
        raise LabFileError(f"{file}: cannot be used; compare it with docs/lab_file.md")
    return LabFile(room=room, drones=drones, mocap=mocap, limits=given, clock=clock, file=file)


def _quantity(raw: object, key: str, bounds: Bounds, problems: Problems) -> Quantity | None:
    """A quantity within its bounds, or a plain number in the unit of the schema."""
    unit = bounds.unit
    if isinstance(raw, int | float) and not isinstance(raw, bool):
        raw = {"value": raw, "unit": unit, "sigma": 0.0, "source": PLAIN_SOURCE}
    elif not isinstance(raw, Mapping):
        form = f'{{ value, unit = "{unit}", sigma, source }}'
        problems.add(key, f"must be a number in {unit} or a table {form}, not {raw!r}")
        return None
    quantity = parse_quantity(raw, key, Measured(unit, Range.ANY), problems)
    if quantity is None:
        return None
    written = Quantity(float(raw["value"]), str(raw["unit"]), float(raw["sigma"]), quantity.source)
    problem = bounds.problem(quantity.value, written)
    if problem is not None:
        problems.add(key, problem)
        return None
    return quantity


def _section(
    section: type[SectionT],
    raw: object,
    key: str,
    problems: Problems,
    others: Mapping[str, object] | None = None,
) -> SectionT | None:
    """A section's dataclass; quantities with a default may be missing, None among `others` is a failure."""
    table = _table(raw, key, problems)
    if table is None:
        return None
    extra, rules, before = dict(others or {}), bounds_of(section), len(problems.messages)
    check_keys(table, key, [*extra, *rules], problems)
    values: dict[str, Any] = {}
    for name, rule in rules.items():
        if name in table:
            values[name] = _quantity(table[name], f"{key}.{name}", rule, problems)
        elif not hasattr(section, name):
            problems.add(f"{key}.{name}", f"is missing; add {name} = a number in {rule.unit}")
    if len(problems.messages) > before or any(value is None for value in extra.values()):
        return None
    return section(**extra, **values)


def _table(raw: object, key: str, problems: Problems) -> Mapping[str, object] | None:
    if raw is None:
        problems.add(key, "is missing; docs/lab_file.md shows a whole file")
        return None
    return as_table(raw, key, problems)


def _room(raw: object, problems: Problems) -> LabRoom | None:
    table = _table(raw, "room", problems)
    if table is None:
        return None
    ceiling = _section(Ceiling, table.get("ceiling"), "room.ceiling", problems)
    start = _section(StartMark, table.get("start"), "room.start", problems)
    return _section(LabRoom, table, "room", problems, others={"ceiling": ceiling, "start": start})


def _check_room(room: LabRoom, drones: tuple[LabDrone, ...], problems: Problems, *, simulated: bool) -> None:
    """Note a room that is too narrow, a ceiling that nothing here lands on, and start marks outside."""
    geometry = room.geometry()
    for axis, low, high in (("x", geometry.x_min, geometry.x_max), ("y", geometry.y_min, geometry.y_max)):
        if not high - low >= NARROWEST:
            problems.add(
                f"room.{axis}_min",
                f"is {low:g} m; it must be less than {axis}_max, {high:g} m, by {NARROWEST:g} m at least, "
                "because a start keeps 0.25 m from each wall",
            )
    _check_ceiling(geometry, problems, simulated=simulated)
    marks = {"room.start": room.start}
    marks |= {f"drones[{i}].start": drone.start for i, drone in enumerate(drones) if drone.start is not None}
    for key, mark in marks.items():
        x, y, _ = mark.pose
        if not (geometry.x_min < x < geometry.x_max and geometry.y_min < y < geometry.y_max):
            problems.add(
                key, f"is at x = {x:g} m, y = {y:g} m, outside the walls; move the mark or the walls"
            )


def _check_ceiling(room: RoomGeometry, problems: Problems, *, simulated: bool) -> None:
    """Note a plane that is steeper than its tilts each, that a simulated room does not have, or too low."""
    steepest = math.degrees(
        math.atan(math.hypot(math.tan(room.ceiling_tilt_x), math.tan(room.ceiling_tilt_y)))
    )
    if simulated and steepest > 0.0:
        problems.add("room.ceiling", "tilts; the ceilings of simulated rooms are level: leave out the tilts")
    elif not CEILING_TILT.contains(steepest):
        problems.add(
            "room.ceiling",
            f"tilts by {steepest:.2g} deg along x and y together; it must be {CEILING_TILT.most:g} deg at "
            f"most: {CEILING_TILT.why_least}",
        )
    if not room.lowest_ceiling > room.floor_z:
        problems.add(
            "room.ceiling",
            f"comes down to {room.lowest_ceiling:g} m between the walls; it must be above the floor at "
            f"{room.floor_z:g} m everywhere: check height and tilts",
        )


def _drones(raw: object, problems: Problems) -> tuple[LabDrone, ...]:
    if not isinstance(raw, list) or not raw:
        problems.add("drones", "is missing; add [[drones]] with uri and vehicle")
        return ()
    drones = [_drone(row, f"drones[{i}]", problems) for i, row in enumerate(raw)]
    found = tuple(drone for drone in drones if drone is not None)
    uris = [drone.uri for drone in found]
    for index, uri in enumerate(uris):
        if uri in uris[:index]:
            problems.add("drones", f"{uri} stands twice; every drone has an address of its own")
    return found


def _drone(raw: object, key: str, problems: Problems) -> LabDrone | None:
    table = as_table(raw, key, problems)
    if table is None:
        return None
    before = len(problems.messages)
    check_keys(table, key, _DRONE_KEYS, problems)
    texts = {
        name: as_text(table.get(name), f"{key}.{name}", problems, required=name in ("uri", "vehicle"))
        for name in _DRONE_KEYS
        if name not in ("start", "own_law")
    }
    own_law = table.get("own_law", False)
    if not isinstance(own_law, bool):
        problems.add(f"{key}.own_law", "must be true or false")
    start = None
    if "start" in table:
        start = _section(StartMark, table["start"], f"{key}.start", problems)
    uri, vehicle = texts.pop("uri"), texts.pop("vehicle")
    if len(problems.messages) > before or uri is None or vehicle is None:
        return None
    return LabDrone(uri=uri, vehicle=vehicle, start=start, own_law=own_law is True, **texts)


def _mocap(raw: object, problems: Problems) -> LabMocap | None:
    table = _table(raw, "mocap", problems)
    if table is None:
        return None
    uri = as_text(table.get("uri"), "mocap.uri", problems)
    named = None
    if uri is not None:
        uri, named = split_subject(uri)
    subject = as_text(table.get("subject"), "mocap.subject", problems, required=named is None) or named
    if named is not None and subject != named:
        problems.add(
            "mocap.subject", f"is {subject!r}, but mocap.uri asks for {named!r}; leave one of them out"
        )
    return _section(
        LabMocap,
        table,
        "mocap",
        problems,
        others={
            "uri": uri,
            "subject": subject,
            "subject_to_body": _subject_to_body(table.get("subject_to_body", {}), problems),
        },
    )


def _subject_to_body(raw: object, problems: Problems) -> SubjectToBody | None:
    key = "mocap.subject_to_body"
    table = as_table(raw, key, problems)
    if table is None:
        return None
    before, usual = len(problems.messages), SubjectToBody()
    check_keys(table, key, ("position", "quaternion"), problems)
    position = usual.position
    if "position" in table:
        parts = _list(table["position"], 3, f"{key}.position", problems)
        found = [_quantity(part, f"{key}.position[{i}]", OFFSET, problems) for i, part in parts]
        known = [part for part in found if part is not None]
        if len(known) == 3:
            position = known[0], known[1], known[2]
    quaternion = usual.quaternion
    if "quaternion" in table:
        quaternion = _quaternion(table["quaternion"], f"{key}.quaternion", problems)
    if len(problems.messages) > before:
        return None
    return SubjectToBody(position=position, quaternion=quaternion)


def _list(raw: object, length: int, key: str, problems: Problems) -> list[tuple[int, object]]:
    if isinstance(raw, list) and len(raw) == length:
        return list(enumerate(raw))
    problems.add(key, f"must be a list of {length} numbers, not {raw!r}")
    return []


def _quaternion(raw: object, key: str, problems: Problems) -> Quaternion:
    """A unit quaternion; the identity, with the problem noted, when it is none."""
    before = len(problems.messages)
    found = [finite(part, f"{key}[{index}]", problems) for index, part in _list(raw, 4, key, problems)]
    numbers = [part for part in found if part is not None]
    if len(numbers) == 4 and abs(math.hypot(*numbers) - 1.0) <= _NORM_TOLERANCE:
        return numbers[0], numbers[1], numbers[2], numbers[3]
    if len(problems.messages) == before:
        problems.add(key, f"must be x, y, z, w of unit length, not {raw!r}; no rotation is [0, 0, 0, 1]")
    return SubjectToBody().quaternion


def _limits(raw: object, rules: Mapping[str, Bounds], problems: Problems) -> dict[str, Quantity]:
    table = as_table(raw, "limits", problems)
    if table is None:
        return {}
    check_keys(table, "limits", rules, problems)
    found = {
        name: _quantity(table[name], f"limits.{name}", rule, problems)
        for name, rule in rules.items()
        if name in table
    }
    return {name: quantity for name, quantity in found.items() if quantity is not None}
