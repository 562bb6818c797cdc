"""The public tables of thrust against voltage that come with the project's data."""

import csv
from pathlib import Path

import numpy as np

from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.errors import ThrustTableError
from onboard.arrays import FloatArray
from onboard.gravity import GRAM_FORCE

BITCRAZE_2015 = frozenset({"amps", "thrust_g", "volt", "pwm_pct_fixed", "rpm"})
FOERSTER = frozenset({"cmd", "thrust_N"})

_FOERSTER_SUPPLY = 4.0
"""V: what the authors' digitised points take for the supply; the thesis' own reading is not recorded."""
_IDLE_COMMAND = 200.0
"""Points below are the idle pair of the digitised figure."""


def read_columns(path: Path) -> tuple[tuple[str, ...], dict[str, list[str]], list[int]]:
    """Columns of a CSV file as text, with the row numbers; lines that begin with # are skipped.

    Raises:
        ThrustTableError: not readable, no header, or a row with another number of cells.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ThrustTableError(f"{path}: cannot be read: {error}") from error
    numbered = [(at, line) for at, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    if not numbered:
        raise ThrustTableError(f"{path}: empty; expected a header and rows")
    try:
        cells = list(csv.reader(line for _, line in numbered))
    except csv.Error as error:
        raise ThrustTableError(f"{path}: cannot be read as CSV: {error}") from error
    if len(cells) != len(numbered):
        raise ThrustTableError(f"{path}: a quoted cell runs over several lines")
    header = tuple(cell.strip() for cell in cells[0])
    rows = [at for at, _ in numbered[1:]]
    for at, row in zip(rows, cells[1:], strict=True):
        if len(row) != len(header):
            raise ThrustTableError(f"{path} row {at}: {len(row)} cells where the header has {len(header)}")
    columns = {name: [row[index].strip() for row in cells[1:]] for index, name in enumerate(header)}
    return header, columns, rows


def numbers(path: Path, name: str, cells: list[str], rows: list[int]) -> FloatArray:
    """A column as numbers.

    Raises:
        ThrustTableError: a cell that is no finite number, by row and column.
    """
    values = np.zeros(len(cells))
    for index, (cell, row) in enumerate(zip(cells, rows, strict=True)):
        try:
            values[index] = float(cell)
        except ValueError:
            values[index] = np.nan
        if not np.isfinite(values[index]):
            raise ThrustTableError(f"{path} row {row} column {name!r}: {cell!r} is not a number")
    return values


def bitcraze_2015(path: Path, columns: dict[str, list[str]], rows: list[int]) -> ThrustData:
    """Bitcraze's table of 2015: total thrust of four motors in g, supply, duty in percent.

    The duty is the table's, corrected where it has a typo; rows at rest do not enter.
    """
    total = numbers(path, "thrust_g", columns["thrust_g"], rows)
    volt = numbers(path, "volt", columns["volt"], rows)
    percent = numbers(path, "pwm_pct_fixed", columns["pwm_pct_fixed"], rows)
    turning = total > 0.0
    return ThrustData(
        name=path.name,
        source="Bitcraze 2015, crazyflie-firmware docs, pwm-to-thrust (GPL-3.0)",
        voltage=(volt * percent / 100.0)[turning],
        thrust=(total / 4.0 * GRAM_FORCE)[turning],
        block=interleaved(int(turning.sum())),
    )


def foerster(path: Path, columns: dict[str, list[str]], rows: list[int]) -> ThrustData:
    """Foerster's points, digitised: command 0..65535, thrust of one motor in N; supply taken as 4.0 V."""
    command = numbers(path, "cmd", columns["cmd"], rows)
    thrust = numbers(path, "thrust_N", columns["thrust_N"], rows)
    # A digitised point that falls behind those of lower commands lies where the figure's curve ends.
    turning = (command > _IDLE_COMMAND) & (thrust >= np.maximum.accumulate(thrust))
    return ThrustData(
        name=path.name,
        source="Foerster 2015, ETH Zurich, points digitised by B. Habas",
        voltage=(command / 65535.0 * _FOERSTER_SUPPLY)[turning],
        thrust=thrust[turning],
        block=interleaved(int(turning.sum())),
    )


def interleaved(count: int) -> FloatArray:
    """Blocks of a table that has one sweep only: every fifth point, so that each spans the whole range."""
    return np.arange(count, dtype=np.float64) % 5.0
