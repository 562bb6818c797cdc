"""Recordings from files: our own CSV, the authors' ground logs of 2022, and cfclient logs as of 2024."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from calibration.bench.inertia.errors import SwingFileError
from calibration.bench.inertia.swing import CLOCK_WRAP_S, Swing
from onboard.arrays import FloatArray, Vector
from onboard.csv_file import CsvFile, CsvRow, read_csv, write_csv

OWN_HEADER = (
    "t_ms",
    *("gyro_x[rad/s]", "gyro_y[rad/s]", "gyro_z[rad/s]"),
    *("acc_x[m/s2]", "acc_y[m/s2]", "acc_z[m/s2]"),
)
"""Columns of our own files; the last three may be absent together."""

_CLIENT = tuple(f"gyro.{axis}_{part}" for axis in "xyz" for part in "xy")  # .._x is ms, .._y is deg/s
_GROUND = ("k_ep", "k_run", "t", "wx", "wy", "wz", "Error")
_GROUND_SUMMARY_S = 5.0  # rows before this are left-over summaries of the logger


def read_swing(path: str | Path, axis: Vector | None = None) -> Swing:
    """Read a recording (.csv or .csv.gz); its kind is told from the header.

    Args:
        path: the file.
        axis: body axis that hung vertical, where known.

    Raises:
        SwingFileError: not readable, of no known kind, or broken (names file, row and column).
    """
    path = Path(path)
    table = read_csv(path, SwingFileError)
    for test, reader in _KINDS:
        if test(table.header):
            return reader(table, axis)
    raise SwingFileError(
        f"{path}: not a recording of a swing (columns {', '.join(table.header[:8])}, ...); "
        f"expected {','.join(OWN_HEADER)}, or a cfclient log of gyro.x, gyro.y and gyro.z"
    )


def write_swing(path: str | Path, swing: Swing) -> None:
    """Write a recording as our own CSV (.csv, or .csv.gz), time in whole ms as the drone stamps it.

    Raises:
        SwingFileError: the host stamped it (the format has no place to say so), or it cannot be written.
    """
    path = Path(path)
    if swing.clock != "drone":
        raise SwingFileError(f"{path}: only recordings stamped by the drone are kept; {swing.source} is not")
    columns = [swing.gyro] if swing.acceleration is None else [swing.gyro, swing.acceleration]
    values = np.column_stack(columns)
    rows = (
        [str(round(1e3 * float(t))), *(repr(float(v)) for v in row)]
        for t, row in zip(swing.time, values, strict=True)
    )
    try:
        write_csv(path, OWN_HEADER[: 1 + values.shape[1]], rows)
    except OSError as error:
        raise SwingFileError(f"{path}: {error.strerror}") from error


def _vectors(table: CsvFile, names: Sequence[str], rows: Sequence[CsvRow] | None = None) -> FloatArray:
    return np.column_stack([table.finite(name, rows) for name in names])


def _own(table: CsvFile, axis: Vector | None) -> Swing:
    stamps = table.finite(OWN_HEADER[0])
    wrong = (stamps < 0.0) | (stamps >= 1e3 * CLOCK_WRAP_S) | (stamps != np.round(stamps))
    if wrong.any():
        row = table.rows[int(np.argmax(wrong))]
        raise table.problem(row, OWN_HEADER[0], "not a 24-bit number of milliseconds")
    has_acceleration = set(OWN_HEADER[4:]) <= set(table.header)
    return Swing(
        1e-3 * stamps,
        _vectors(table, OWN_HEADER[1:4]),
        str(table.path),
        _vectors(table, OWN_HEADER[4:]) if has_acceleration else None,
        "drone",
        axis,
    )


def _client(table: CsvFile, axis: Vector | None) -> Swing:
    times = _vectors(table, _CLIENT[0::2])
    apart = np.any(times != times[:, :1], axis=1)
    if apart.any():
        row = table.rows[int(np.argmax(apart))].number
        columns = ", ".join(repr(name) for name in _CLIENT[0::2])
        raise SwingFileError(
            f"{table.path} row {row} columns {columns}: the times differ; log the three rates in one block"
        )
    rates = math.pi / 180.0 * _vectors(table, _CLIENT[1::2])
    return Swing(1e-3 * times[:, 0], rates, str(table.path), None, "drone", axis)


def _ground(table: CsvFile, axis: Vector | None) -> Swing:
    error = table.index("Error")
    samples = [row for row in table.rows if not row.cells[error].strip()]
    time = table.finite("t", samples)
    rows = [row for row, t in zip(samples, time, strict=True) if t >= _GROUND_SUMMARY_S]
    rates = _vectors(table, ("wx", "wy", "wz"), rows)
    return Swing(table.finite("t", rows), rates, str(table.path), None, "host", axis)


_KINDS: tuple[tuple[Callable[[tuple[str, ...]], bool], Callable[[CsvFile, Vector | None], Swing]], ...] = (
    (lambda header: set(OWN_HEADER[:4]) <= set(header), _own),
    (lambda header: set(_CLIENT) <= set(header), _client),
    (lambda header: set(_GROUND) <= set(header), _ground),
)
