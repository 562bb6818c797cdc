"""Files of tachometer recordings: our own edges and commands, and the authors' window-averaged logs.

=============  =====================  ==================================================================
kind           header                 content
=============  =====================  ==================================================================
edges          ``t_us,edge_count``    micros() of each edge, unwrapped or not, and the running count
commands       ``t_us,command``       micros() at which the motor was told `command` (0..65535)
authors' logs  ``time,omega``         s, rad/s over a window (data of Habas 2022, counts of 2 marks)
=============  =====================  ==================================================================

Any of them may be gzipped (``.gz``).
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibration.bench.motors.errors import TachometerError
from calibration.bench.motors.records import CommandRecord, EdgeRecord, WindowRecord
from onboard.arrays import FloatArray
from onboard.csv_file import CsvFile, read_csv, write_csv

EDGE_HEADER = ("t_us", "edge_count")
COMMAND_HEADER = ("t_us", "command")
LEGACY_HEADER = ("time", "omega")

WRAP_US = 1 << 32
"""micros() of an Arduino starts again after 71.6 min."""
_MOST_COMMAND = 65535
_FASTEST = 1e5
"""rad/s: thirty times what the motors of small drones reach."""
_LONGEST_PAUSE = 3600.0
"""s without anything: no motor rests so long between two steps; a clock that jumps does."""


def read_tachometer(path: Path) -> EdgeRecord | WindowRecord:
    """A recording in any of the formats, told apart by its header.

    Raises:
        TachometerError: not readable, an unknown header, or a cell that is no number, a speed that no motor
            has or a time that jumps, by file and row.
    """
    table = read_csv(path, TachometerError)
    if table.header == EDGE_HEADER:
        times = _unwrapped(table.integers("t_us")) * 1e-6
        _refuse_jump(table, "t_us", times)
        return EdgeRecord(times, table.integers("edge_count"), path.name)
    if table.header == LEGACY_HEADER:
        if len(table.rows) < 2:
            raise TachometerError(f"{path}: {len(table.rows)} samples; a recording has at least two")
        _refuse_jump(table, "time", table.finite("time"))
        return WindowRecord(table.finite("time"), table.finite("omega", largest=_FASTEST), name=path.name)
    known = " or ".join(repr(",".join(names)) for names in (EDGE_HEADER, LEGACY_HEADER))
    raise TachometerError(
        f"{path}: header {','.join(table.header)!r} is not of a tachometer; expected {known}"
    )


def read_commands(path: Path) -> CommandRecord:
    """The commands beside a recording of edges.

    Raises:
        TachometerError: not readable, another header, or a command outside 0..65535, by file and row.
    """
    table = read_csv(path, TachometerError)
    if table.header != COMMAND_HEADER:
        raise TachometerError(
            f"{path}: header {','.join(table.header)!r}; expected {','.join(COMMAND_HEADER)!r}"
        )
    commands = table.integers("command")
    for k in np.flatnonzero((commands < 0) | (commands > _MOST_COMMAND))[:1]:
        raise table.problem(table.rows[k], "command", f"{commands[k]} is not in 0..{_MOST_COMMAND}")
    return CommandRecord(_unwrapped(table.integers("t_us")) * 1e-6, commands.astype(np.float64))


def write_edges(path: Path, record: EdgeRecord) -> None:
    """Write a recording of edges; whole microseconds are kept exactly."""
    _write(path, EDGE_HEADER, record.times, record.counts)


def write_commands(path: Path, record: CommandRecord) -> None:
    """Write commands (whole numbers) with their times."""
    _write(path, COMMAND_HEADER, record.times, record.commands.astype(np.int64))


def _write(path: Path, header: tuple[str, ...], times: FloatArray, values: NDArray[np.int64]) -> None:
    ticks = np.rint(times * 1e6).astype(np.int64)
    write_csv(path, header, ((str(tick), str(value)) for tick, value in zip(ticks, values, strict=True)))


def _refuse_jump(table: CsvFile, column: str, times: FloatArray) -> None:
    for row in np.flatnonzero(np.diff(times) > _LONGEST_PAUSE)[:1]:
        what = f"time jumps by {times[row + 1] - times[row]:.3g} s; cut the recording there"
        raise table.problem(table.rows[row + 1], column, what)


def _unwrapped(times: NDArray[np.int64]) -> FloatArray:
    """Microseconds that go on where micros() started again.

    A step back by nearly all of 2^32 is the counter's own; any other is a reset and stays visible.
    """
    ticks = times.copy()
    wraps = np.diff(ticks) < -(WRAP_US - WRAP_US // 64)
    ticks[1:] += np.cumsum(wraps) * WRAP_US
    return ticks.astype(np.float64)
