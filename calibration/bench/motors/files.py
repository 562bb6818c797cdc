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

import csv
import gzip
import io
import math
import zlib
from pathlib import Path

import numpy as np

from calibration.bench.motors.errors import TachometerError
from calibration.bench.motors.records import CommandRecord, EdgeRecord, WindowRecord

EDGE_HEADER = ("t_us", "edge_count")
COMMAND_HEADER = ("t_us", "command")
LEGACY_HEADER = ("time", "omega")

WRAP_US = 1 << 32
"""micros() of an Arduino starts again after 71.6 min."""
_MOST_COMMAND = 65535
_LARGEST = 1 << 62


def read_tachometer(path: Path) -> EdgeRecord | WindowRecord:
    """A recording in any of the formats, told apart by its header.

    Raises:
        TachometerError: not readable, an unknown header, or a cell that is no number, by file and row.
    """
    header, rows = _read(path)
    if header == EDGE_HEADER:
        times, counts = _integers(path, rows)
        seconds = _unwrapped(times) * 1e-6
        return EdgeRecord(seconds, np.array(counts, dtype=np.int64), path.name)
    if header == LEGACY_HEADER:
        if len(rows) < 2:
            raise TachometerError(f"{path}: {len(rows)} samples; a recording has at least two")
        values = np.array([[_number(path, row, cell) for cell in cells] for row, cells in rows])
        return WindowRecord(values[:, 0], values[:, 1], name=path.name)
    known = " or ".join(repr(",".join(names)) for names in (EDGE_HEADER, LEGACY_HEADER))
    raise TachometerError(f"{path}: header {','.join(header)!r} is not of a tachometer; expected {known}")


def read_commands(path: Path) -> CommandRecord:
    """The commands beside a recording of edges.

    Raises:
        TachometerError: not readable, another header, or a command outside 0..65535, by file and row.
    """
    header, rows = _read(path)
    if header != COMMAND_HEADER:
        raise TachometerError(f"{path}: header {','.join(header)!r}; expected {','.join(COMMAND_HEADER)!r}")
    times, commands = _integers(path, rows)
    for (row, _), command in zip(rows, commands, strict=True):
        if not 0 <= command <= _MOST_COMMAND:
            raise TachometerError(f"{path} row {row}: command {command} is not in 0..{_MOST_COMMAND}")
    return CommandRecord(_unwrapped(times) * 1e-6, np.array(commands, dtype=np.float64))


def write_edges(path: Path, record: EdgeRecord) -> None:
    """Write a recording of edges; whole microseconds are kept exactly."""
    ticks = np.rint(record.times * 1e6).astype(np.int64)
    lines = [",".join(EDGE_HEADER), *(f"{t},{n}" for t, n in zip(ticks, record.counts, strict=True))]
    _write(path, lines)


def write_commands(path: Path, record: CommandRecord) -> None:
    """Write commands (whole numbers) with their times."""
    ticks = np.rint(record.times * 1e6).astype(np.int64)
    commands = record.commands.astype(np.int64)
    _write(path, [",".join(COMMAND_HEADER), *(f"{t},{c}" for t, c in zip(ticks, commands, strict=True))])


def _unwrapped(times: list[int]) -> np.ndarray:
    """Microseconds that go on where micros() started again.

    A step back by nearly all of 2^32 is the counter's own; any other is a reset and stays visible.
    """
    ticks = np.array(times, dtype=np.int64)
    wraps = np.diff(ticks) < -(WRAP_US - WRAP_US // 64)
    ticks[1:] += np.cumsum(wraps) * WRAP_US
    return ticks.astype(np.float64)


def _read(path: Path) -> tuple[tuple[str, ...], list[tuple[int, list[str]]]]:
    """Header and the rows that are not blank, each with its number in the file."""
    try:
        raw = path.read_bytes()
        text = (gzip.decompress(raw) if path.suffix == ".gz" else raw).decode("utf-8")
        reader = csv.reader(io.StringIO(text, newline=""))
        header = tuple(cell.strip() for cell in next(reader, []))
        rows = [(reader.line_num, cells) for cells in reader if cells]
    except OSError as error:
        raise TachometerError(f"{path}: {error.strerror or error}; check the name of the file") from error
    except (UnicodeDecodeError, EOFError, zlib.error, csv.Error) as error:
        raise TachometerError(f"{path}: cannot be read as CSV: {error}") from error
    for row, cells in rows:
        if len(cells) != len(header):
            raise TachometerError(f"{path} row {row}: {len(cells)} cells where the header has {len(header)}")
    return header, rows


def _integers(path: Path, rows: list[tuple[int, list[str]]]) -> tuple[list[int], list[int]]:
    pairs = [(_integer(path, row, cells[0]), _integer(path, row, cells[1])) for row, cells in rows]
    return [pair[0] for pair in pairs], [pair[1] for pair in pairs]


def _integer(path: Path, row: int, cell: str) -> int:
    try:
        value = int(cell)
    except ValueError:
        raise TachometerError(f"{path} row {row}: {cell!r} is not a whole number") from None
    if abs(value) > _LARGEST:
        raise TachometerError(f"{path} row {row}: {cell!r} is too large")
    return value


def _number(path: Path, row: int, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise TachometerError(f"{path} row {row}: {cell!r} is not a number")
    return value


def _write(path: Path, lines: list[str]) -> None:
    text = "\n".join(lines) + "\n"
    if path.suffix == ".gz":
        with gzip.GzipFile(path, "wb", mtime=0) as stream:
            stream.write(text.encode())
    else:
        path.write_text(text, encoding="utf-8")
