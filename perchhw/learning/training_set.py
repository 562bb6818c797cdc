"""Sensory-motor pairs to train a policy on: our sweep's table and the authors'.

A pair is the cues at which a flip was triggered and the moment that it used, with the landing rate that it
reached.
"""

import csv
import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from onboard.arrays import FloatArray
from onboard.errors import InputError
from perchhw.errors import FlightStackError

LANDING_RATE_MIN = 0.8
"""Pairs with at least this landing rate train a policy (paper, section "Flip Trigger Policy")."""

PLAUSIBLE_ANGLE_DEG = (1.0, 90.0)
"""A row outside is a misprint: the authors' table has one with 0.24 deg, which no sweep commanded."""


class TrainingSetError(FlightStackError, InputError):
    """A table of pairs that cannot be used: the message names file, row and column."""


@dataclass(frozen=True)
class TrainingSet:
    """Pairs good enough to train on.

    Attributes:
        states: (n, 3) float64: tau [s], theta_x [rad/s, positive forward], d_ceil [m].
        a_rot: (n,) float64: moment about b_y, N m, negative = nose up.
        landing_rate: (n,) of each pair.
        source: what the pairs came from and how they were chosen, for the policy's provenance.
    """

    states: FloatArray
    a_rot: FloatArray
    landing_rate: FloatArray
    source: Mapping[str, str | int | float]


@dataclass(frozen=True)
class _Format:
    """Columns of a table and the factors that turn them into our signs and units."""

    name: str
    angle: str
    landing_rate: str
    state: tuple[str, str, str]
    a_rot: str
    theta_x_factor: float
    a_rot_factor: float


def _sweep_format(rate_column: str) -> _Format:
    """``pairs.csv`` of ``perchhw learn sweep``."""
    state = ("tau", "theta_x", "d_ceil")
    return _Format("perchhw sweep", "angle_deg", rate_column, state, "a_rot", 1.0, 1.0)


_AUTHORS_FORMAT = _Format(
    "authors' training set (OF_y = -theta_x, N mm)",
    "phi_d",
    "LR_4Leg",
    ("Tau_flip_mean", "OFy_flip_mean", "D_ceil_flip_mean"),
    "My_mean",
    -1.0,
    1.0e-3,
)


def load_training_set(
    path: str | Path, *, landing_rate_min: float = LANDING_RATE_MIN, rate_column: str = "landing_rate"
) -> TrainingSet:
    """Read the pairs that reach a landing rate: our ``pairs.csv`` or the authors' ``training_set_NL.csv``.

    Rows with a lower rate are left out; they need no cues. A row with an implausible angle is left out too.

    Args:
        path: CSV with a header.
        landing_rate_min: lowest rate to train on.
        rate_column: which of our rates decides (our table has several; the authors' has one).

    Raises:
        TrainingSetError: naming file, row and column. The header is line 1.
    """
    path = Path(path)
    content, rows = _read(path)
    form = _format_of(rows, path, rate_column)
    plausible = [(line, row) for line, row in rows if _has_plausible_angle(row, form, path, line)]
    rated = [(line, row, _rate(row, form, path, line)) for line, row in plausible]
    chosen = [_pair(row, form, path, line, rate) for line, row, rate in rated if rate >= landing_rate_min]
    if not chosen:
        raise TrainingSetError(
            f"{path}: no row has {form.landing_rate} >= {landing_rate_min:g}; lower the limit or sweep more"
        )
    numbers = np.array(chosen, dtype=np.float64)
    source: dict[str, str | int | float] = {
        "table": path.name,
        "format": form.name,
        "sha256": hashlib.sha256(content).hexdigest(),
        "rows": len(rows),
        "rate_column": form.landing_rate,
        "landing_rate_min": landing_rate_min,
        "pairs": len(chosen),
        "rows_with_implausible_angle": len(rows) - len(plausible),
    }
    return TrainingSet(states=numbers[:, :3], a_rot=numbers[:, 3], landing_rate=numbers[:, 4], source=source)


def _read(path: Path) -> tuple[bytes, list[tuple[int, dict[str, str]]]]:
    """The bytes of a table, and its rows by line number."""
    try:
        content = path.read_bytes()
        return content, _numbered_rows(content.decode("utf-8-sig"), path)
    except OSError as error:
        raise TrainingSetError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise TrainingSetError(f"{path}: is not a CSV text file ({error})") from error


def _numbered_rows(text: str, path: Path) -> list[tuple[int, dict[str, str]]]:
    reader = csv.DictReader(text.splitlines())
    rows = [(reader.line_num, row) for row in reader]
    if not rows:
        raise TrainingSetError(f"{path}: has no rows; give a pairs.csv of perchhw learn sweep")
    return rows


def _format_of(rows: list[tuple[int, dict[str, str]]], path: Path, rate_column: str) -> _Format:
    columns = rows[0][1].keys()
    form = _AUTHORS_FORMAT if _AUTHORS_FORMAT.a_rot in columns else _sweep_format(rate_column)
    for column in (form.angle, form.landing_rate, *form.state, form.a_rot):
        if column not in columns:
            raise TrainingSetError(f"{path}: line 1: column {column} is missing ({form.name})")
    return form


def _number(row: Mapping[str, str], column: str, path: Path, line: int) -> float:
    text = row[column]
    try:
        value = float(text)
    except (TypeError, ValueError) as error:
        raise TrainingSetError(
            f"{path}: line {line}: {column} is {text!r}, not a number; correct it"
        ) from error
    if not math.isfinite(value):
        raise TrainingSetError(
            f"{path}: line {line}: {column} is {text!r}, not a usable number; remove the row"
        )
    return value


def _has_plausible_angle(row: Mapping[str, str], form: _Format, path: Path, line: int) -> bool:
    low, high = PLAUSIBLE_ANGLE_DEG
    return low <= _number(row, form.angle, path, line) <= high


def _rate(row: Mapping[str, str], form: _Format, path: Path, line: int) -> float:
    rate = _number(row, form.landing_rate, path, line)
    if not 0 <= rate <= 1:
        raise TrainingSetError(
            f"{path}: line {line}: {form.landing_rate} is {rate:g}, not a rate from 0 to 1"
        )
    return rate


def _pair(
    row: Mapping[str, str], form: _Format, path: Path, line: int, rate: float
) -> tuple[float, float, float, float, float]:
    tau, flow, d_ceil = (_number(row, column, path, line) for column in form.state)
    a_rot = _number(row, form.a_rot, path, line) * form.a_rot_factor
    for column, value, problem in (
        (form.state[0], tau > 0, "must be above 0: the pair was triggered on an approach"),
        (form.state[2], d_ceil > 0, "must be above 0: the drone is below the ceiling"),
        (form.a_rot, a_rot <= 0, "must be negative: it is the signed moment about b_y, nose up"),
    ):
        if not value:
            raise TrainingSetError(f"{path}: line {line}: {column} is {row[column]}, but {problem}")
    return tau, flow * form.theta_x_factor, d_ceil, a_rot, rate
