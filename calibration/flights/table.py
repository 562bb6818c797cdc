"""Flights as a plain table: ``t,x,y,z,qx,qy,qz,qw`` and any further channels, CSV or CSV.gz, SI units.

Also reads the truth files of ``perchhw sim lab --truth`` (rates named ``wx,wy,wz`` and a column ``drone``).
A column ``pose_source`` says where the pose comes from (:class:`PoseSource`), unless from motion capture. An
empty cell is a missing value.
"""

from pathlib import Path

import numpy as np

from calibration.flights.flight import (
    CHANNELS,
    POSE_CHANNELS,
    Flight,
    FlightFileError,
    PoseSource,
    Trigger,
    UnusableFlightError,
    finite_masks,
)
from calibration.flights.flight_format import FlightFormat, csv_with
from onboard.app_interface import LandingState
from onboard.arrays import FloatArray
from onboard.csv_file import CsvFile, read_csv

_REQUIRED = ("t", *POSE_CHANNELS)
_ALIASES = {"wx": "gx", "wy": "gy", "wz": "gz"}
_DRONE, _POSE_SOURCE = "drone", "pose_source"
_NO_CHANNELS = frozenset({"t", _DRONE, _POSE_SOURCE})
_NORM_TOLERANCE = 0.05
_FLIPPING = 0.5  # cosine of the tilt beyond which the vehicle is taken to flip


def is_table(header: tuple[str, ...]) -> bool:
    """Whether a CSV header is of this format."""
    return set(_REQUIRED) <= set(header) and all(_channel(n) in {*CHANNELS, *_NO_CHANNELS} for n in header)


def load_table(path: Path) -> Flight:
    """Read a table.

    Raises:
        FlightFileError: broken; names row and column.
        UnusableFlightError: fewer than two rows.
    """
    return read_csv(path, FlightFileError, may_be_torn=True).read_as(_flight)


FORMAT = FlightFormat(csv_with(is_table), load_table)


def _flight(file: CsvFile) -> Flight:
    path = file.path
    _check_header(file)
    if len(file.rows) < 2:
        raise UnusableFlightError(path, f"only {len(file.rows)} data rows")
    t = file.time()
    data = {_channel(n): file.column(n) for n in file.header if n not in _NO_CHANNELS}
    _check_quaternion(file, data)
    trigger, notes = _trigger(t, data)
    return Flight(
        name=path.name.removesuffix(".gz").removesuffix(".csv"),
        source=path,
        format="table",
        pose_source=_pose_source(file),
        t=t,
        data=data,
        valid=finite_masks(data),
        trigger=trigger,
        ceiling_z=_ceiling(data),
        session=str(path.parent),
        notes=(*notes, *([file.torn] if file.torn else [])),
    )


def _pose_source(file: CsvFile) -> PoseSource:
    """What the table says; without a word motion capture, or the truth where it has what only a simulation
    knows."""
    said = file.text(_POSE_SOURCE) if _POSE_SOURCE in file.header else [""] * len(file.rows)
    for row, name in zip(file.rows, said, strict=True):
        if name not in {"", *PoseSource}:
            raise file.problem(row, _POSE_SOURCE, f"{name!r} is none of {', '.join(PoseSource)}")
    found = {PoseSource(name) for name in said if name}
    if len(found) > 1:
        raise FlightFileError(
            f"{file.path} column {_POSE_SOURCE!r}: {len(found)} sources in one table; give one file for each"
        )
    usual = PoseSource.TRUTH if "legs_attached" in file.header else PoseSource.MOCAP
    return found.pop() if found else usual


def _ceiling(data: dict[str, FloatArray]) -> float | None:
    """Height of the ceiling (m) where the table has the distance to it."""
    if "d_ceil" not in data:
        return None
    height = data["z"] + data["d_ceil"]
    known = height[np.isfinite(height)]
    return float(np.median(known)) if known.size else None


def _channel(name: str) -> str:
    return _ALIASES.get(name, name)


def _check_header(file: CsvFile) -> None:
    for name in _REQUIRED:
        file.index(name)
    unknown = [n for n in file.header if _channel(n) not in {*CHANNELS, *_NO_CHANNELS}]
    if unknown:
        raise FlightFileError(f"{file.path} row 1: unknown column {', '.join(unknown)}; see docs/records.md")
    repeated = {n for n in file.header if [_channel(m) for m in file.header].count(_channel(n)) > 1}
    if repeated:
        raise FlightFileError(f"{file.path} row 1: column given twice: {', '.join(sorted(repeated))}")
    if _DRONE in file.header:
        index = file.index(_DRONE)
        drones = {row.cells[index] for row in file.rows}
        if len(drones) > 1:
            raise FlightFileError(
                f"{file.path} column 'drone': {len(drones)} drones in one table; give one file per drone"
            )


def _check_quaternion(file: CsvFile, data: dict[str, FloatArray]) -> None:
    norm = np.linalg.norm(np.column_stack([data[q] for q in ("qx", "qy", "qz", "qw")]), axis=1)
    bad = np.flatnonzero(np.abs(norm - 1.0) > _NORM_TOLERANCE)  # NaN (missing) compares false
    if bad.size:
        place = f"{file.path} row {file.rows[bad[0]].number} columns 'qx'..'qw'"
        raise FlightFileError(f"{place}: not a unit quaternion (norm {norm[bad[0]]:.3f})")


def _trigger(t: FloatArray, data: dict[str, FloatArray]) -> tuple[Trigger | None, tuple[str, ...]]:
    """The trigger, and a note when it had to be inferred from the attitude."""
    for name, value in (("triggered", 1.0), ("landing_state", float(LandingState.FLIP))):
        if name in data:
            fired = np.flatnonzero(data[name] == value)
            return (Trigger(float(t[fired[0]])) if fired.size else None), ()
    upright = 1.0 - 2.0 * (data["qx"] ** 2 + data["qy"] ** 2)
    turned = np.flatnonzero(upright < _FLIPPING)
    if turned.size == 0:
        return None, ()
    begun = float(t[turned[0]])
    return Trigger(begun, inferred=True), (
        f"no column triggered: 60 deg of tilt at {begun:.2f} s are taken for a flip, and may be a crash",
    )
