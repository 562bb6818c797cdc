"""Reading tables of cues (tau, theta_x, d_ceil) at which a policy is to be evaluated."""

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from onboard.errors import InputError, OnboardError
from onboard.policy.model import Float32Array

STATE_COLUMNS = ("tau", "theta_x", "d_ceil")


class StateTableError(OnboardError, InputError):
    """A table of cues that cannot be used: the message names file, row and column."""


def read_states(path: str | Path) -> Float32Array:
    """Read a CSV with (at least) the columns ``tau`` [s], ``theta_x`` [rad/s] and ``d_ceil`` [m].

    An infinite tau is allowed: it means that the drone does not approach.

    Returns:
        (n, 3) float32 in the order of the policy's inputs.

    Raises:
        StateTableError: the file, a column or a number is missing or wrong. Rows are counted as a text
            editor does: the header is line 1.
    """
    path = Path(path)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            return _read(file, path)
    except OSError as error:
        raise StateTableError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise StateTableError(f"{path}: is not a CSV text file ({error})") from error


def _read(file: TextIO, path: Path) -> Float32Array:
    rows = csv.reader(file)
    header = [cell.strip() for cell in next(rows, [])]
    missing = [name for name in STATE_COLUMNS if name not in header]
    if missing:
        found = ", ".join(header) or "nothing"
        raise StateTableError(
            f"{path}: line 1: column {', '.join(missing)} is missing; the first line must name tau, theta_x "
            f"and d_ceil (found: {found})"
        )
    repeated = [name for name in STATE_COLUMNS if header.count(name) > 1]
    if repeated:
        raise StateTableError(
            f"{path}: line 1: column given twice: {', '.join(repeated)}; leave the one that counts"
        )
    columns = [header.index(name) for name in STATE_COLUMNS]
    numbers = []
    for row in rows:
        if row:
            where = f"{path}: line {rows.line_num}"
            named = zip(columns, STATE_COLUMNS, strict=True)
            numbers.append([_number(row, column, name, where) for column, name in named])
    with np.errstate(over="ignore"):  # beyond float32 is as far away as infinity
        return np.array(numbers, dtype=np.float64).reshape(-1, len(STATE_COLUMNS)).astype(np.float32)


def _number(row: Sequence[str], column: int, name: str, where: str) -> float:
    if column >= len(row):
        raise StateTableError(f"{where}: column {name} is missing; the row ends after {len(row)} columns")
    try:
        value = float(row[column])
    except ValueError as error:
        raise StateTableError(
            f"{where}: column {name}: {row[column]!r} is not a number; correct it"
        ) from error
    if math.isnan(value):
        raise StateTableError(
            f"{where}: column {name}: {row[column]!r} is not a usable number; remove the row"
        )
    return value
