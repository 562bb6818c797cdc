"""Sensory-motor pairs to train a policy on: our sweep's table and the authors'.

A pair is the cues at which a flip was triggered and the moment that it used, with the landing rate that it
reached.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from onboard.arrays import BoolArray, FloatArray
from onboard.checked_arguments import checked_number
from onboard.csv_file import CsvFile, CsvRow, read_csv
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
    path: str | Path,
    *,
    landing_rate_min: float = LANDING_RATE_MIN,
    rate_column: str = "landing_rate",
    share_of_best: float = 0.0,
) -> TrainingSet:
    """Read the pairs that reach a landing rate: our ``pairs.csv`` or the authors' ``training_set_NL.csv``.

    Rows with a lower rate are left out; they need no cues. A row with an implausible angle is left out too.

    Args:
        path: CSV with a header.
        landing_rate_min: lowest rate to train on.
        rate_column: which of our rates decides (our table has several; the authors' has one).
        share_of_best: lowest rate, as a share of the best at the same speed and angle: where few conditions
            reach a high rate, each still teaches what is best there. 0: as it comes.

    Raises:
        TrainingSetError: naming file, row and column (the header is row 1); or the limit is no rate.
        ArgumentError: nor is it a number.
    """
    path = Path(path)
    landing_rate_min = checked_number(landing_rate_min, "landing_rate_min")
    if not 0.0 <= landing_rate_min <= 1.0:
        raise TrainingSetError(f"landing_rate_min {landing_rate_min:g} is no rate: give 0 to 1")
    table = read_csv(path, TrainingSetError)
    if not table.rows:
        raise TrainingSetError(f"{path}: has no rows; give a pairs.csv of perchhw learn sweep")
    form = _AUTHORS_FORMAT if _AUTHORS_FORMAT.a_rot in table.header else _sweep_format(rate_column)
    low, high = PLAUSIBLE_ANGLE_DEG
    angles = table.finite(form.angle)
    plausible = [row for row, angle in zip(table.rows, angles, strict=True) if low <= angle <= high]
    rates = table.finite(form.landing_rate, plausible)
    _require(table, form.landing_rate, plausible, (rates >= 0) & (rates <= 1), "is not a rate from 0 to 1")
    good = rates >= landing_rate_min
    if share_of_best > 0.0:
        good &= rates >= share_of_best * _best_of_condition(table, plausible, form.angle, rates)
    chosen = [row for row, taken in zip(plausible, good, strict=True) if taken]
    if not chosen:
        raise TrainingSetError(
            f"{path}: no row has {form.landing_rate} >= {landing_rate_min:g}; lower the limit or sweep more"
        )
    tau, flow, d_ceil = (table.finite(column, chosen) for column in form.state)
    a_rot = table.finite(form.a_rot, chosen) * form.a_rot_factor
    for column, fits, rule in (
        (form.state[0], tau > 0, "must be above 0: the pair was triggered on an approach"),
        (form.state[2], d_ceil > 0, "must be above 0: the drone is below the ceiling"),
        (form.a_rot, a_rot <= 0, "must be negative: it is the signed moment about b_y, nose up"),
    ):
        _require(table, column, chosen, fits, rule)
    source: dict[str, str | int | float] = {
        "table": path.name,
        "format": form.name,
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "rows": len(table.rows),
        "rate_column": form.landing_rate,
        "landing_rate_min": landing_rate_min,
        "share_of_best": share_of_best,
        "pairs": len(chosen),
        "rows_with_implausible_angle": len(table.rows) - len(plausible),
    }
    return TrainingSet(
        states=np.column_stack([tau, flow * form.theta_x_factor, d_ceil]),
        a_rot=a_rot,
        landing_rate=rates[good],
        source=source,
    )


def _best_of_condition(table: CsvFile, rows: Sequence[CsvRow], angle: str, rates: FloatArray) -> FloatArray:
    """The highest rate (n,) at the speed and angle of each row."""
    conditions = np.column_stack([table.finite("speed_m_s", rows), table.finite(angle, rows)])
    _, group = np.unique(conditions, axis=0, return_inverse=True)
    best = np.zeros(group.max() + 1)
    np.maximum.at(best, group, rates)
    return best[group]


def _require(table: CsvFile, column: str, rows: Sequence[CsvRow], fits: BoolArray, rule: str) -> None:
    """Name the first row whose cell does not fit."""
    for bad in np.flatnonzero(~fits)[:1]:
        cell = rows[bad].cells[table.index(column)].strip()
        raise table.problem(rows[bad], column, f"{cell} {rule}")
