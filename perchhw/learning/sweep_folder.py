"""The folder of a sweep: ``pairs.csv`` with one row a trial, ``sweep.json`` with settings and counts."""

import csv
import io
import json
from pathlib import Path
from typing import Any

from perchhw.learning.errors import LearningInputError

SCHEMA = "perchhw.sweep/1"
PAIRS_FILE, SWEEP_FILE = "pairs.csv", "sweep.json"

COLUMNS = (
    "speed_m_s", "angle_deg", "trial", "tau", "theta_x", "d_ceil", "a_rot", "landing_rate", "four_leg_rate",
    "body_contact_rate", "reward", "rollouts", "converged", "two_leg_rate", "episodes", "mu_tau", "sigma_tau",
    "mu_moment_nmm", "sigma_moment_nmm", "steps", "not_finite",
)  # fmt: skip
"""Columns of ``pairs.csv``: SI, a_rot in N m (negative = nose up), mu and sigma in the units of EPHE."""

Row = dict[str, float | int | None]
Key = tuple[float, float, int]


def csv_line(row: Row) -> str:
    """One line of ``pairs.csv``; None is empty."""
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(
        ["" if row[name] is None else repr(row[name]) for name in COLUMNS]
    )
    return line.getvalue()


def open_folder(folder: Path, document: dict[str, Any], resume: bool) -> dict[Key, Row]:
    """Make or check the folder; the rows that it already holds.

    Raises:
        LearningInputError: it holds another sweep, or holds one and `resume` was not asked for.
    """
    settings_path, pairs_path = folder / SWEEP_FILE, folder / PAIRS_FILE
    if not pairs_path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write_settings(folder, document)
        write_pairs(folder, ())
        return {}
    if not resume:
        raise LearningInputError(
            f"{folder} already holds a sweep: add --resume to go on, or choose another --out"
        )
    before = read_settings(settings_path)
    for part in ("settings", "versions"):
        for name, value in document[part].items():
            if before.get(part, {}).get(name) != value:
                raise LearningInputError(
                    f"{settings_path}: {name} is {before.get(part, {}).get(name)!r} there and {value!r} now: "
                    "resume with the same settings and versions, or choose another --out"
                )
    rows = read_pairs(pairs_path, cut_tail=True)
    write_pairs(folder, tuple(rows.values()))
    return rows


def write_settings(folder: Path, document: dict[str, Any]) -> None:
    """Write ``sweep.json``."""
    _replace(folder / SWEEP_FILE, json.dumps(document, indent=1) + "\n")


def read_settings(path: Path) -> dict[str, Any]:
    """The document of a ``sweep.json``.

    Raises:
        LearningInputError: the file cannot be read, or is not one of this version.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LearningInputError(
            f"{path}: cannot be read ({error}): restore it, or sweep into another folder"
        ) from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise LearningInputError(
            f"{path}: is not a sweep of this version ({SCHEMA}): restore it, or sweep into another folder"
        )
    return document


def read_pairs(path: Path, cut_tail: bool = False) -> dict[Key, Row]:
    """Rows of a ``pairs.csv`` by (speed, angle, trial).

    Args:
        path: the file.
        cut_tail: leave out an unfinished last line, as a killed process leaves it.

    Raises:
        LearningInputError: naming file, line and column.
    """
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    if not lines or lines[0].strip() != ",".join(COLUMNS):
        raise LearningInputError(f"{path}: line 1: the columns are not those of this version")
    if cut_tail and not lines[-1].endswith("\n"):
        lines.pop()
    rows: dict[Key, Row] = {}
    for number, line in enumerate(lines[1:], start=2):
        cells = line.rstrip("\n").split(",")
        if len(cells) != len(COLUMNS):
            raise LearningInputError(f"{path}: line {number}: {len(cells)} values, not {len(COLUMNS)}")
        row: Row = {}
        for name, cell in zip(COLUMNS, cells, strict=True):
            try:
                row[name] = None if cell == "" else float(cell) if _is_real(name) else int(cell)
            except ValueError as error:
                raise LearningInputError(
                    f"{path}: line {number}: {name} is {cell!r}, not a number"
                ) from error
        rows[(float(row["speed_m_s"] or 0), float(row["angle_deg"] or 0), int(row["trial"] or 0))] = row
    return rows


def _is_real(column: str) -> bool:
    return column not in ("trial", "rollouts", "converged", "episodes", "not_finite")


def write_pairs(folder: Path, rows: tuple[Row, ...]) -> None:
    """Write the whole ``pairs.csv``."""
    _replace(folder / PAIRS_FILE, ",".join(COLUMNS) + "\n" + "".join(csv_line(row) for row in rows))


def _replace(path: Path, text: str) -> None:
    """Write a file so that a kill leaves either the old or the new one."""
    draft = path.with_name(path.name + ".part")
    draft.write_text(text, encoding="utf-8")
    draft.replace(path)
