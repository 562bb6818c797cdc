"""The folder of a sweep: ``pairs.csv`` with one row a trial, ``sweep.json`` with settings and counts."""

import csv
import io
import json
import math
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from onboard.json_file import as_json, parsed
from onboard.schema import schema_problem
from perchhw.learning.errors import LearningInputError

SCHEMA = "perchhw.sweep/1"
PAIRS_FILE, SWEEP_FILE = "pairs.csv", "sweep.json"
POLICY_FILE, TRAINING_FILE = "policy.policy.json", "training.json"
VALIDATION_FILE, VALIDATION_SUMMARY = "validation.csv", "validation.json"
MEASURED_FILE, AS_FLOWN_FILE = "validation_measured.csv", "validation_as_flown.csv"

COLUMNS = (
    "speed_m_s", "angle_deg", "trial", "tau", "theta_x", "d_ceil", "a_rot", "landing_rate", "four_leg_rate",
    "body_contact_rate", "reward", "rollouts", "converged", "two_leg_rate", "episodes", "mu_tau", "sigma_tau",
    "mu_moment_nmm", "sigma_moment_nmm", "steps", "not_finite", "not_finite_rollouts",
)  # fmt: skip
"""Columns of ``pairs.csv``: SI, a_rot in N m (negative = nose up), mu and sigma in the units of EPHE.

``not_finite_rollouts`` numbers the rollouts of the trial that were not finite, from 0, blanks between."""

_WHOLE = ("trial", "rollouts", "converged", "episodes", "not_finite")
_MAY_BE_EMPTY = ("tau", "theta_x", "d_ceil", "a_rot", "not_finite_rollouts")

Row = dict[str, float | int | str | None]
Key = tuple[float, float, int]


def csv_line(row: Row) -> str:
    """One line of ``pairs.csv``; None is empty."""
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow([cell(row[name]) for name in COLUMNS])
    return line.getvalue()


def cell(value: float | int | str | None) -> str:
    """A value of a row as text that reads back as the same value."""
    return "" if value is None else value if isinstance(value, str) else repr(value)


def not_finite_report(row: Row, seed: int) -> dict[str, Any]:
    """What names the rollouts of a row that were not finite, enough to fly each again (`one_trial`)."""
    where: dict[str, Any] = {name: row[name] for name in ("speed_m_s", "angle_deg", "trial") if name in row}
    return {
        **where,
        "rollouts": [int(index) for index in str(row["not_finite_rollouts"] or "").split()],
        "seed": seed,
    }


def open_folder(
    folder: Path, document: dict[str, Any], keys: Collection[Key], resume: bool
) -> dict[Key, Row]:
    """Make or check the folder; the rows that it already holds.

    Args:
        folder: of the sweep.
        document: what ``sweep.json`` has to say.
        keys: trials of the sweep.
        resume: go on with the rows in the folder.

    Raises:
        LearningInputError: it cannot be written, it holds another sweep or a damaged one, or holds one and
            `resume` was not asked for.
    """
    settings_path, pairs_path = folder / SWEEP_FILE, folder / PAIRS_FILE
    make_folder(folder)
    if not pairs_path.exists():
        write_settings(folder, document)
        write_pairs(folder, ())
        return {}
    if not resume:
        raise LearningInputError(
            f"{folder} already holds a sweep: add --resume to go on, or choose another --out"
        )
    _refuse_another_sweep(read_settings(settings_path), document, settings_path)
    rows = read_pairs(pairs_path, cut_tail=True)
    for line, key in enumerate(rows, start=2):
        if key not in keys:
            raise LearningInputError(
                f"{pairs_path}: line {line}: {key[0]:g} m/s, {key[1]:g} deg, trial {key[2]} is no trial of "
                "this sweep: restore the file, or sweep into another folder"
            )
    write_pairs(folder, tuple(rows.values()))
    return rows


def _refuse_another_sweep(before: dict[str, Any], now: dict[str, Any], path: Path) -> None:
    for part in ("settings", "versions"):
        old, new = before.get(part, {}), json.loads(json.dumps(now[part]))
        for name in {**old, **new}:
            if old.get(name) != new.get(name):
                raise LearningInputError(
                    f"{path}: {name} is {old.get(name)!r} there and {new.get(name)!r} now: resume with the "
                    "same settings and versions, or choose another --out"
                )


def new_folder(folder: Path) -> None:
    """Make a folder for a policy that has no pairs, or take one without results.

    Raises:
        LearningInputError: it cannot be made or written, or holds a sweep, a policy or a validation.
    """
    for name in (PAIRS_FILE, SWEEP_FILE, POLICY_FILE, TRAINING_FILE, VALIDATION_FILE, VALIDATION_SUMMARY):
        if (folder / name).exists():
            raise LearningInputError(f"{folder} already holds results ({name}): choose another --out")
    make_folder(folder)


def make_folder(folder: Path) -> None:
    """Make a folder for results, and see that it takes files.

    Raises:
        LearningInputError: it cannot be made or written.
    """
    probe = folder / ".writable"
    with _named_if_unwritable(folder):
        folder.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()


@contextmanager
def append_rows(folder: Path) -> Iterator[Callable[[Row], None]]:
    """A function that appends a row to ``pairs.csv``, on disk at once.

    Raises:
        LearningInputError: the file cannot be written.
    """
    path = folder / PAIRS_FILE
    with _named_if_unwritable(path):
        file = path.open("a", encoding="utf-8", newline="")
    with file:

        def append(row: Row) -> None:
            with _named_if_unwritable(path):
                file.write(csv_line(row))
                file.flush()

        yield append


def write_settings(folder: Path, document: dict[str, Any]) -> None:
    """Write ``sweep.json``."""
    write_document(folder / SWEEP_FILE, document)


def read_settings(path: Path) -> dict[str, Any]:
    """The document of a ``sweep.json``.

    Raises:
        LearningInputError: the file cannot be read, or is not one of this version.
    """
    try:
        document = parsed(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LearningInputError(
            f"{path}: cannot be read ({error}): restore it, or sweep into another folder"
        ) from error
    if not isinstance(document, dict):
        raise LearningInputError(f"{path}: is no sweep: restore it, or sweep into another folder")
    problem = schema_problem(document.get("schema"), SCHEMA)
    if problem is not None:
        raise LearningInputError(f"{path}: schema {problem}; restore the sweep, or sweep into another folder")
    for part in ("settings", "versions"):
        if not isinstance(document.get(part, {}), dict):
            raise LearningInputError(f"{path}: {part} is no table: restore it, or sweep into another folder")
    return document


def read_pairs(path: Path, cut_tail: bool = False) -> dict[Key, Row]:
    """Rows of a ``pairs.csv`` by (speed, angle, trial).

    Args:
        path: the file.
        cut_tail: leave out an unfinished last line, as a killed process leaves it.

    Raises:
        LearningInputError: naming file, line and column.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    except (OSError, ValueError) as error:
        raise LearningInputError(
            f"{path}: cannot be read ({error}): restore it, or sweep into another folder"
        ) from error
    if not lines or lines[0].strip() != ",".join(COLUMNS):
        raise LearningInputError(
            f"{path}: line 1: the columns are not those of this version: sweep into another folder"
        )
    if cut_tail and not lines[-1].endswith("\n"):
        lines.pop()
    rows: dict[Key, Row] = {}
    for number, line in enumerate(lines[1:], start=2):
        row = _read_row(line.rstrip("\n"), f"{path}: line {number}")
        key = (float(row["speed_m_s"] or 0), float(row["angle_deg"] or 0), int(row["trial"] or 0))
        if key in rows:
            raise LearningInputError(f"{path}: line {number}: has the trial of an earlier line: remove one")
        rows[key] = row
    return rows


def _read_row(line: str, where: str) -> Row:
    cells = line.split(",")
    if len(cells) != len(COLUMNS):
        raise LearningInputError(f"{where}: {len(cells)} values, not {len(COLUMNS)}: remove the line")
    row: Row = {}
    for name, text in zip(COLUMNS, cells, strict=True):
        try:
            row[name] = _value(name, text)
        except ValueError as error:
            raise LearningInputError(f"{where}: {name} is {text!r}, {error}: remove the line") from error
    return row


def _value(name: str, text: str) -> float | int | str | None:
    if text == "" and name in _MAY_BE_EMPTY:
        return None
    if name == "not_finite_rollouts":
        if not all(index.isdigit() for index in text.split()):
            raise ValueError("no list of rollouts")
        return text
    try:
        value = int(text) if name in _WHOLE else float(text)
    except ValueError:
        raise ValueError("not a number") from None
    if not math.isfinite(value):
        raise ValueError("not a finite number")
    if name.endswith("_rate") and not 0.0 <= value <= 1.0:
        raise ValueError("not a rate from 0 to 1")
    return value


def write_pairs(folder: Path, rows: tuple[Row, ...]) -> None:
    """Write the whole ``pairs.csv``."""
    write_file(folder / PAIRS_FILE, ",".join(COLUMNS) + "\n" + "".join(csv_line(row) for row in rows))


def write_file(path: Path, text: str) -> None:
    """Write a file so that a kill leaves either the old or the new one.

    Raises:
        LearningInputError: it cannot be written.
    """
    draft = path.with_name(path.name + ".part")
    with _named_if_unwritable(path):
        draft.write_text(text, encoding="utf-8")
        draft.replace(path)


def write_document(path: Path, document: Any) -> None:
    """Write what :func:`onboard.json_file.as_json` knows, as :func:`write_file` does.

    Raises:
        LearningInputError: it cannot be written.
    """
    write_file(path, json.dumps(as_json(document), indent=1, allow_nan=False) + "\n")


@contextmanager
def _named_if_unwritable(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise LearningInputError(
            f"{path}: cannot be written ({error.strerror}): make it writable, or choose another --out"
        ) from error
