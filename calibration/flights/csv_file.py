"""Read a CSV or CSV.gz file of numbers with errors that name row and column."""

import csv
import gzip
import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO, cast

import numpy as np

from calibration.flights.flight import FlightFileError
from onboard.arrays import FloatArray


@dataclass(frozen=True)
class CsvRow:
    """One line of a file: its number there (the header is 1) and its cells."""

    number: int
    cells: list[str]


@dataclass(frozen=True)
class CsvFile:
    """A CSV file as text: the header and all lines that are not blank."""

    path: Path
    header: tuple[str, ...]
    rows: tuple[CsvRow, ...]

    def column(
        self, name: str, rows: Sequence[CsvRow] | None = None, missing: Sequence[str] = ("",)
    ) -> FloatArray:
        """Column `name` of `rows` (default all) as numbers, NaN for the texts in `missing`.

        Raises:
            FlightFileError: no such column, or a cell that is no number (named by row and column).
        """
        index = self.index(name)
        chosen = self.rows if rows is None else rows
        return np.array([self.number(row, index, missing) for row in chosen], dtype=np.float64)

    def time(self, rows: Sequence[CsvRow] | None = None, missing: Sequence[str] = ("",)) -> FloatArray:
        """The column ``t`` of `rows` (default all), which every row has and which never goes back.

        Raises:
            FlightFileError: it is not so in the row that is named.
        """
        chosen = self.rows if rows is None else rows
        t = self.column("t", chosen, missing)
        absent = np.flatnonzero(~np.isfinite(t))
        if absent.size:
            raise FlightFileError(f"{self.path} row {chosen[absent[0]].number} column 't': no time")
        back = np.flatnonzero(np.diff(t) < 0)
        if back.size:
            raise FlightFileError(f"{self.path} row {chosen[back[0] + 1].number} column 't': time goes back")
        return t

    def index(self, name: str) -> int:
        """Position of the column `name`."""
        if name not in self.header:
            raise FlightFileError(f"{self.path}: no column {name!r}; found {', '.join(self.header)}")
        return self.header.index(name)

    def number(self, row: CsvRow, index: int, missing: Sequence[str]) -> float:
        """The cell `index` of `row` as a number."""
        text = row.cells[index].strip()
        if text in missing:
            return math.nan
        try:
            return float(text)
        except ValueError:
            place = f"{self.path} row {row.number} column {self.header[index]!r}"
            raise FlightFileError(f"{place}: {text!r} is not a number") from None


def read_header(path: Path) -> tuple[str, ...]:
    """The first line of a CSV file, for telling formats apart; empty when it is not text."""
    try:
        with _open(path) as stream:
            return tuple(cell.strip() for cell in next(csv.reader(stream), []))
    except (UnicodeDecodeError, gzip.BadGzipFile, EOFError, zlib.error, csv.Error):
        return ()


def read_csv(path: Path) -> CsvFile:
    """Read `path`.

    Raises:
        FlightFileError: not readable as CSV, no header, or a row whose number of cells differs from the
            header's.
    """
    rows: list[CsvRow] = []
    header: tuple[str, ...] = ()
    try:
        with _open(path) as stream:
            reader = csv.reader(stream)
            header = tuple(cell.strip() for cell in next(reader, []))
            if not header:
                raise FlightFileError(f"{path}: empty first row; expected a header")
            for cells in reader:
                if not cells:
                    continue
                if len(cells) != len(header):
                    place = f"{path} row {reader.line_num}"
                    raise FlightFileError(
                        f"{place}: {len(cells)} cells where the header has {len(header)}; "
                        f"the row ends in column {header[min(len(cells), len(header)) - 1]!r}"
                    )
                rows.append(CsvRow(reader.line_num, cells))
    except (UnicodeDecodeError, gzip.BadGzipFile, EOFError, zlib.error, csv.Error) as error:
        raise FlightFileError(f"{path}: cannot be read after row {len(rows) + 1}: {error}") from error
    except OSError as error:
        raise FlightFileError(f"{path}: {error.strerror}") from error
    return CsvFile(path, header, tuple(rows))


def _open(path: Path) -> TextIO:
    if path.suffix == ".gz":
        return cast(TextIO, gzip.open(path, "rt", encoding="utf-8", newline=""))
    return path.open(encoding="utf-8", newline="")
