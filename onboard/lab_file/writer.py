"""Writing a lab file that reads back as the same lab."""

import os
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path

from onboard.lab_file.model import (
    SCHEMA,
    Ceiling,
    LabDrone,
    LabFile,
    LabFileError,
    LabMocap,
    LabRoom,
    StartMark,
    plain,
)
from onboard.quantity import Quantity
from onboard.toml_file import quantity_table, toml_key, toml_text


def write_lab_file(path: Path, lab: LabFile, comment: str = "") -> None:
    """Replace `path` by the text of `lab` in one step; `comment` comes first.

    Raises:
        LabFileError: the file cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    heading = "".join(f"# {line}\n" for line in comment.splitlines())
    try:
        temporary.write_text(heading + lab_to_toml(lab), encoding="utf-8")
        temporary.replace(path)
    except OSError as problem:
        raise LabFileError(
            f"{path}: cannot be written ({problem.strerror}); choose another place"
        ) from problem


def lab_to_toml(lab: LabFile) -> str:
    """The text of a lab file."""
    lines = [f"schema = {toml_text(SCHEMA)}"]
    lines += [] if lab.clock is None else [f"clock = {toml_text(lab.clock)}"]
    lines += ["", "[room]", *_lines(lab.room)]
    measured = measured_lines(lab)
    lines += [*measured["room"], f"start = {_inline(lab.room.start)}"]
    for drone in lab.drones:
        lines += ["", "[[drones]]", *_drone_lines(drone)]
    mocap = lab.mocap
    lines += ["", "[mocap]", f"uri = {toml_text(mocap.uri)}", f"subject = {toml_text(mocap.subject)}"]
    lines += measured["mocap"]
    if lab.limits:
        lines += ["", "[limits]", *(f"{toml_key(key)} = {_number(q)}" for key, q in lab.limits.items())]
    return "\n".join(lines) + "\n"


def measured_lines(lab: LabFile) -> dict[str, list[str]]:
    """The lines of a lab file that `perchhw mocap calibrate` measures, by table."""
    mocap = lab.mocap
    position = ", ".join(_number(part) for part in mocap.subject_to_body.position)
    quaternion = ", ".join(repr(part) for part in mocap.subject_to_body.quaternion)
    body = f"subject_to_body = {{ position = [{position}], quaternion = [{quaternion}] }}"
    return {"room": [f"ceiling = {_inline(lab.room.ceiling)}"], "mocap": [body, *_lines(mocap)]}


def _drone_lines(drone: LabDrone) -> Iterable[str]:
    others = ("start", "own_law")
    texts = {item.name: getattr(drone, item.name) for item in fields(drone) if item.name not in others}
    yield from (f"{key} = {toml_text(text)}" for key, text in texts.items() if text is not None)
    if drone.start is not None:
        yield f"start = {_inline(drone.start)}"
    if drone.own_law:
        yield "own_law = true"


def _lines(section: LabRoom | LabMocap | Ceiling | StartMark) -> list[str]:
    """A line for each quantity of a section."""
    values = {item.name: getattr(section, item.name) for item in fields(section)}
    return [f"{key} = {_number(value)}" for key, value in values.items() if isinstance(value, Quantity)]


def _inline(section: Ceiling | StartMark) -> str:
    return f"{{ {', '.join(_lines(section))} }}"


def _number(quantity: Quantity) -> str:
    """A plain number where it says as much as the quantity."""
    if quantity == plain(quantity.value, quantity.unit):
        return repr(quantity.value)
    return quantity_table(quantity)
