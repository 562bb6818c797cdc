"""Flights of the paper's authors (Habas and Cheng, 2022): ground logs as CSV or CSV.gz.

Source: bhabas/sar_simulation, crazyflie_projects/Supervised_ML/Data_Logs/SVL_Experimental_Data (MIT).
What the loader corrects:

- Rows whose ``Error`` is not ``--`` are summaries that reuse the columns for other things. ``Flip Data`` is
  the trigger snapshot taken on board; its time is wrong in most logs, so the time comes from flag and moment.
- ``flip_flag`` and moments at the head of a log are left over from the previous attempt.
- The authors number motors M1 front left, M2 rear left, M3 rear right, M4 front right.
- ``OF_y`` = -theta_x. ``My`` during the flip is 2 a_rot. N mm and grams-force become N m and N.
- Values were wrapped into 16 bits: +-32.767 and d_ceil < 0 are no values. ``Volts`` has a floor at 3.500.
- ``Tau`` 0 means "not approaching": infinite here, and not valid. It is truncated to whole ms (not corrected;
  add :data:`TAU_TRUNCATION_S` before replaying a policy).
- The pose estimate fails during some flips: from the first impossible step after the trigger on, the pose is
  not valid (the values stay, for looking at).
- Telemetry that freezes with the vehicle turning is not valid from there.

A row is the latest content of 5-6 radio blocks: values within one row differ in age by up to 20 ms. Only the
snapshot is one sample.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.flights.flight import (
    POSE_CHANNELS,
    Flight,
    FlightFileError,
    PoseSource,
    Trigger,
    UnusableFlightError,
    finite_masks,
)
from calibration.flights.flight_format import FlightFormat, csv_with
from onboard.arrays import BoolArray, FloatArray
from onboard.csv_file import CsvFile, CsvRow, read_csv
from onboard.gravity import GRAM_FORCE

TAU_TRUNCATION_S = 0.5e-3
"""Mean of what truncation to 1 ms took away from the logged tau."""

_SIGNATURE = ("k_ep", "k_run", "Policy_Flip", "flip_flag", "Tau", "OF_y", "F_thrust", "Error")
_WRAPPED = 32.766  # int16 in thousandths: nothing beyond this is a value
_VOLTS_FLOOR = 3.500
_MINIMUM_HEIGHT_M = 0.5  # a log that stays below never flew an approach
_MISSING = ("--",)

_COPIED = {
    **{name: name for name in (*POSE_CHANNELS, "vx", "vy", "vz", "d_ceil")},
    **{"gx": "wx", "gy": "wy", "gz": "wz", "tau": "Tau", "trigger_value": "Policy_Flip", "vbat": "Volts"},
    **{f"setpoint_{a}": f"x_d.{a}" for a in "xyz"},
    **{f"setpoint_v{a}": f"v_d.{a}" for a in "xyz"},
    **{f"setpoint_a{a}": f"a_d.{a}" for a in "xyz"},
    "collective": "F_thrust",
}
_THEIR_MOTOR = {1: 4, 2: 3, 3: 2, 4: 1}  # ours: theirs


def is_habas(header: tuple[str, ...]) -> bool:
    """Whether a CSV header is of this format."""
    return set(_SIGNATURE) <= set(header)


def load_habas(path: Path) -> Flight:
    """Read one of the authors' flights.

    Raises:
        FlightFileError: broken; names row and column.
        UnusableFlightError: readable, but the vehicle never left the floor.
    """
    file = read_csv(path, FlightFileError)
    for name in _SIGNATURE:
        file.index(name)
    error = file.index("Error")
    rows = tuple(r for r in file.rows if r.cells[error] == "--")
    summaries = {r.cells[error]: r for r in file.rows if r.cells[error] != "--"}
    if not rows:
        raise UnusableFlightError(path, "no data rows")
    t = file.time(rows, _MISSING)
    data = _channels(file, rows)
    flag = _flag_without_leftover(file, rows)
    trigger_row = _trigger_row(flag, data)
    _finish_flip_channels(data, flag, trigger_row)
    log = _Log(t, data, finite_masks(data), trigger_row, [])
    _reject_wrapped(log)
    _reject_frozen(log)
    ceiling_z = _ceiling(log)
    _reject_pose(log, ceiling_z)
    highest = float(np.max(log.data["z"][log.valid["z"]], initial=0.0))
    if highest < _MINIMUM_HEIGHT_M:
        raise UnusableFlightError(path, f"never leaves the floor (highest z {highest:.2f} m)")
    speed, angle = _commanded(path, file, summaries)
    return Flight(
        name=path.name.removesuffix(".gz").removesuffix(".csv"),
        source=path,
        format="habas",
        pose_source=PoseSource.ONBOARD_ESTIMATE,
        t=t,
        data=data,
        valid=log.valid,
        trigger=_trigger(file, summaries, t, trigger_row),
        commanded_speed=speed,
        commanded_angle_deg=angle,
        ceiling_z=ceiling_z,
        session=_day(path),
        notes=tuple(log.notes),
    )


FORMAT = FlightFormat(csv_with(is_habas), load_habas)


@dataclass
class _Log:
    """A log while it is being checked."""

    t: FloatArray
    data: dict[str, FloatArray]
    valid: dict[str, BoolArray]
    trigger_row: int | None
    notes: list[str]

    def reject(self, names: tuple[str, ...], rows: BoolArray) -> None:
        for name in names:
            self.valid[name] &= ~rows


def _channels(file: CsvFile, rows: tuple[CsvRow, ...]) -> dict[str, FloatArray]:
    data = {ours: file.column(theirs, rows, _MISSING) for ours, theirs in _COPIED.items()}
    data["theta_x"] = -file.column("OF_y", rows, _MISSING)
    for axis in "xyz":
        data[f"moment_{axis}"] = file.column(f"M{axis}", rows, _MISSING) * 1e-3
    for ours, theirs in _THEIR_MOTOR.items():
        data[f"m{ours}"] = file.column(f"M{theirs}_pwm", rows, _MISSING)
        data[f"f{ours}"] = file.column(f"M{theirs}_thrust", rows, _MISSING) * GRAM_FORCE
    return data


def _flag_without_leftover(file: CsvFile, rows: tuple[CsvRow, ...]) -> BoolArray:
    """``flip_flag`` with the True rows at the head of the log, left over from the last attempt, cleared."""
    index = file.index("flip_flag")
    flag = np.zeros(len(rows), dtype=np.bool_)
    for i, row in enumerate(rows):
        text = row.cells[index]
        if text not in ("True", "False"):
            place = f"{file.path} row {row.number} column 'flip_flag'"
            raise FlightFileError(f"{place}: {text!r} is neither True nor False")
        flag[i] = text == "True"
    first_false = int(np.argmin(flag)) if not flag.all() else len(flag)
    flag[:first_false] = False
    return flag


def _trigger_row(flag: BoolArray, data: dict[str, FloatArray]) -> int | None:
    """Row of the trigger: where the flag rises, or up to three rows earlier if the moment is there."""
    if not flag.any():
        return None
    rise = int(np.argmax(flag))
    for row in range(max(0, rise - 3), rise):
        if data["collective"][row] == 0.0 and data["moment_y"][row] < 0.0:
            return row
    return rise


def _finish_flip_channels(data: dict[str, FloatArray], flag: BoolArray, trigger_row: int | None) -> None:
    data["triggered"] = flag.astype(np.float64)
    data["a_rot"] = np.full(flag.shape, np.nan)
    if trigger_row is not None:
        flip = (np.arange(flag.size) >= trigger_row) & (data["collective"] == 0.0) & (data["moment_y"] < 0.0)
        data["a_rot"][flip] = data["moment_y"][flip] / 2.0
    data["tau"][data["tau"] == 0.0] = np.inf


def _reject_wrapped(log: _Log) -> None:
    names = ("x", "y", "z", "vx", "vy", "vz", "tau", "theta_x", "d_ceil", "trigger_value", "gz")
    for name in names:
        log.reject((name,), np.abs(log.data[name]) >= _WRAPPED)
    log.reject(("d_ceil",), log.data["d_ceil"] <= 0.0)
    log.reject(("vbat",), log.data["vbat"] <= _VOLTS_FLOOR)


def _ceiling(log: _Log) -> float | None:
    """Height of the ceiling (m) that the vehicle reckoned with: median of d_ceil + z before the trigger."""
    rows = log.valid["d_ceil"] & log.valid["z"] & (log.data["z"] > 0.2)
    if log.trigger_row is not None:
        rows[log.trigger_row :] = False
    if not rows.any():
        return None
    return float(np.median(log.data["d_ceil"][rows] + log.data["z"][rows]))


def _reject_pose(log: _Log, ceiling_z: float | None) -> None:
    """Reject impossible positions, steps faster than 8 m/s, and turns that the gyro did not see."""
    position = np.column_stack([log.data[a] for a in "xyz"])
    quaternion = np.column_stack([log.data[f"q{a}"] for a in "xyzw"])
    dt = np.diff(log.t)
    step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    dot = np.abs(np.sum(quaternion[1:] * quaternion[:-1], axis=1))
    norm = np.linalg.norm(quaternion, axis=1)
    turn = 2.0 * np.arccos(np.clip(dot / np.maximum(norm[1:] * norm[:-1], 1e-9), 0.0, 1.0))
    rate = np.linalg.norm(np.column_stack([log.data[g] for g in ("gx", "gy", "gz")]), axis=1)
    fastest = np.maximum(rate[1:], rate[:-1])
    # 40 ms of slack: a row may hold blocks that are up to two rows apart in age.
    jump = (step > 8.0 * (dt + 0.04)) | (turn > fastest * (dt + 0.04) + 0.35)
    bad = np.concatenate([[False], jump])
    top = np.inf if ceiling_z is None else ceiling_z + 0.05
    bad |= (log.data["z"] > top) | (log.data["z"] < -0.1)
    if log.trigger_row is not None and bad[log.trigger_row :].any():
        first = log.trigger_row + int(np.argmax(bad[log.trigger_row :]))
        bad[first:] = True
        after_ms = (log.t[first] - log.t[log.trigger_row]) * 1e3
        log.notes.append(f"onboard pose impossible {after_ms:.0f} ms after the trigger; not valid from there")
    log.reject((*POSE_CHANNELS, "vx", "vy", "vz"), bad)


def _reject_frozen(log: _Log) -> None:
    """Reject the tail of a log in which nothing changes any more although the vehicle turns."""
    names = ("gx", "gy", "gz", "x", "y", "z")
    changed = np.any([np.diff(log.data[n]) != 0.0 for n in names], axis=0)
    last_change = int(np.flatnonzero(changed)[-1]) + 1 if changed.any() else 0
    rate = np.linalg.norm([log.data[g][-1] for g in ("gx", "gy", "gz")])
    if log.t[-1] - log.t[last_change] < 1.0 or rate < 0.2:
        return
    tail = np.arange(log.t.size) > last_change
    log.reject((*POSE_CHANNELS, "vx", "vy", "vz", "gx", "gy", "gz", "d_ceil"), tail)
    log.notes.append(f"telemetry frozen from {log.t[last_change]:.3f} s to the end ({log.t[-1]:.3f} s)")


def _commanded(path: Path, file: CsvFile, summaries: dict[str, CsvRow]) -> tuple[float | None, float | None]:
    """Commanded speed (m/s) and angle (deg): from the summary, else from the file's name."""
    completed = next((r for text, r in summaries.items() if text.startswith("Rollout Completed")), None)
    if completed is not None:
        speed = file.number(completed, file.index("vx"), _MISSING)
        angle = file.number(completed, file.index("vy"), _MISSING)
        if np.isfinite(speed) and np.isfinite(angle):
            return speed, angle
    match = re.search(r"_(\d+\.\d+)_(\d+\.\d+)_", path.name)
    return (float(match[1]), float(match[2])) if match else (None, None)


def _day(path: Path) -> str:
    """Day of the flight (month-day) from the file's name; empty where it has none."""
    match = re.search(r"_(\d\d-\d\d)_\d\d-\d\d", path.name)
    return match[1] if match else ""


def _trigger(
    file: CsvFile, summaries: dict[str, CsvRow], t: FloatArray, trigger_row: int | None
) -> Trigger | None:
    if trigger_row is None:
        return None
    row = summaries.get("Flip Data")
    if row is None:
        return Trigger(float(t[trigger_row]))

    def cell(name: str) -> float:
        return file.number(row, file.index(name), _MISSING)

    snapshot = {name: cell(name) for name in ("z", "vx", "vy", "vz", "d_ceil")}
    snapshot |= {"tau": cell("Tau"), "theta_x": -cell("OF_y")}
    return Trigger(float(t[trigger_row]), snapshot)
