"""Putting what was measured into a lab file: the rest of its text stays as it is, comments and all."""

import os
import re
from collections.abc import Mapping
from pathlib import Path

from onboard.bounds import Bounds
from onboard.lab_file.model import LabFile, LabFileError
from onboard.lab_file.reader import read_lab_file
from onboard.lab_file.writer import measured_lines

_HEADER = re.compile(r"\s*\[+\s*([^\]#]+?)\s*\]+")
_OWN = {"room": r"ceiling", "mocap": r"(subject_to_body|latency_s)"}
"""What is replaced, by table."""


def put_measured(path: Path, lab: LabFile, limits: Mapping[str, Bounds]) -> None:
    """Replace ceiling, ``subject_to_body`` and latency of a lab file by those of `lab`, in one step.

    Args:
        path: the file.
        lab: what it shall say; all else must be what it says already.
        limits: as of :func:`read_lab_file`.

    Raises:
        LabFileError: it cannot be read or written, the new text does not say this, or a number is out of its
            range. The file is as it was then.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_text(_replaced(path.read_text(encoding="utf-8"), lab), encoding="utf-8")
        if read_lab_file(temporary, limits) != lab:
            raise LabFileError(f"{path}: is written in a way that cannot be changed in place")
        temporary.replace(path)
    except OSError as problem:
        raise LabFileError(f"{path}: cannot be changed ({problem.strerror})") from problem
    except LabFileError as problem:
        lines = "\n".join(line for table in measured_lines(lab).values() for line in table)
        said = str(problem).replace(str(temporary), str(path))
        raise LabFileError(f"{said}\nwhat was measured, for [room] and [mocap]:\n{lines}") from problem
    finally:
        temporary.unlink(missing_ok=True)


def _replaced(text: str, lab: LabFile) -> str:
    new, kept, table = measured_lines(lab), [], ""
    for line in text.splitlines():
        header = _HEADER.match(line)
        if header is not None:
            table = header[1].replace(" ", "")
        own = _OWN.get(table.partition(".")[0])
        if own is not None and re.match(rf"{own}(\.|$)", table.partition(".")[2]):
            continue  # a table of its own, such as [room.ceiling.height]
        if header is None and own is not None and re.match(rf"\s*{own}\s*[.=]", line):
            continue
        kept.append(line)
        if header is not None:
            kept += new.get(table, [])
    return "\n".join(kept) + "\n"
