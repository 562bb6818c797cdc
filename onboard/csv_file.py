"""Read and write tables as CSV or CSV.gz, with errors that name row and column."""

import csv
import gzip
import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TextIO, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import FloatArray
from onboard.errors import PerchhwError

_T = TypeVar("_T")

_LARGEST = 1 << 62
_UNREADABLE = (UnicodeDecodeError, gzip.BadGzipFile, EOFError, zlib.error, csv.Error)


@dataclass(frozen=True)
class CsvRow:
    """One line of a file: its number there (the header is 1) and its cells."""

    number: int
    cells: list[str]


@dataclass(frozen=True)
class CsvFile:
    """A CSV file as text: the header and all lines that are not blank.

    Attributes:
        path: of the file.
        header: names of the columns.
        rows: below it.
        torn: that the last line was left out, in words; empty where it is whole.
        ended: whether the last of the rows has an end. Of one without, the last number may be cut.
        error: raised where a column is not what it is asked to be; its message names row and column.
    """

    path: Path
    header: tuple[str, ...]
    rows: tuple[CsvRow, ...]
    error: type[PerchhwError]
    torn: str = ""
    ended: bool = True

    def read_as(self, read: Callable[["CsvFile"], _T]) -> _T:
        """What `read` makes of the file: where it refuses the last number of a last line without an end, of
        the file without that line.

        Raises:
            PerchhwError: `read` refuses something else.
        """
        try:
            return read(self)
        except self.error as problem:
            if self.ended or len(self.rows) < 2:
                raise
            *rows, last = self.rows
            torn = f"row {last.number} is cut off in its last number: left out"
            # Any cell may be missing, but for a time: there the one before it does no harm.
            harmless = rows[-1].cells[-1] if self.header[-1] == "t" else ""
            try:
                read(replace(self, rows=(*rows, CsvRow(last.number, [*last.cells[:-1], harmless]))))
                return read(replace(self, rows=tuple(rows), torn=torn, ended=True))
            except self.error:
                raise problem from None

    def column(
        self, name: str, rows: Sequence[CsvRow] | None = None, missing: Sequence[str] = ("",)
    ) -> FloatArray:
        """Column `name` of `rows` (default all) as numbers, NaN for the texts in `missing`.

        Raises:
            PerchhwError: no such column or two, or a cell that is no number.
        """
        index = self.index(name)
        chosen = self.rows if rows is None else rows
        return np.array([self.number(row, index, missing) for row in chosen], dtype=np.float64)

    def finite(
        self, name: str, rows: Sequence[CsvRow] | None = None, largest: float = math.inf
    ) -> FloatArray:
        """Column `name` of `rows` (default all), every cell a finite number, none beyond +-`largest`.

        Raises:
            PerchhwError: no such column, or another cell.
        """
        chosen = self.rows if rows is None else rows
        values = self.column(name, chosen)
        for row in np.flatnonzero(~np.isfinite(values))[:1]:
            text = chosen[row].cells[self.index(name)].strip()
            raise self.problem(chosen[row], name, f"{text!r} is not a finite number")
        for row in np.flatnonzero(np.abs(values) > largest)[:1]:
            text = chosen[row].cells[self.index(name)].strip()
            what = f"{text!r} is beyond {largest:g}, which nothing reads; correct it or leave the row out"
            raise self.problem(chosen[row], name, what)
        return values

    def integers(self, name: str) -> NDArray[np.int64]:
        """Column `name`, every cell a whole number of less than 63 bits.

        Raises:
            PerchhwError: no such column, or another cell.
        """
        values = np.zeros(len(self.rows), dtype=np.int64)
        for k, (row, text) in enumerate(zip(self.rows, self.text(name), strict=True)):
            try:
                value = int(text)
            except ValueError:
                raise self.problem(row, name, f"{text!r} is not a whole number") from None
            if abs(value) > _LARGEST:
                raise self.problem(row, name, f"{text!r} is too large")
            values[k] = value
        return values

    def text(self, name: str) -> list[str]:
        """Column `name` as text.

        Raises:
            PerchhwError: no such column.
        """
        index = self.index(name)
        return [row.cells[index].strip() for row in self.rows]

    def time(self, rows: Sequence[CsvRow] | None = None, missing: Sequence[str] = ("",)) -> FloatArray:
        """The column ``t`` of `rows` (default all), which every row has and which never goes back.

        Raises:
            PerchhwError: it is not so in the row that is named.
        """
        chosen = self.rows if rows is None else rows
        t = self.column("t", chosen, missing)
        for row in np.flatnonzero(~np.isfinite(t))[:1]:
            raise self.problem(chosen[row], "t", "no time")
        for row in np.flatnonzero(np.diff(t) < 0)[:1]:
            raise self.problem(chosen[row + 1], "t", "time goes back")
        return t

    def index(self, name: str) -> int:
        """Position of the column `name`.

        Raises:
            PerchhwError: no such column, or two.
        """
        if name not in self.header:
            raise self.error(f"{self.path}: no column {name!r}; found {', '.join(self.header)}")
        if self.header.count(name) > 1:
            raise self.error(f"{self.path} row 1: column given twice: {name}; leave the one that counts")
        return self.header.index(name)

    def number(self, row: CsvRow, index: int, missing: Sequence[str]) -> float:
        """The cell `index` of `row` as a number."""
        text = row.cells[index].strip()
        if text in missing:
            return math.nan
        try:
            return float(text)
        except ValueError:
            raise self.problem(row, self.header[index], f"{text!r} is not a number") from None

    def problem(self, row: CsvRow, column: str, what: str) -> PerchhwError:
        """What is wrong with a cell, as an error to raise."""
        return self.error(f"{self.path} row {row.number} column {column!r}: {what}")


def read_header(path: Path) -> tuple[str, ...]:
    """The first line of a CSV file, for telling formats apart; empty when it is not text."""
    try:
        with _open(path) as stream:
            return tuple(cell.strip() for cell in next(csv.reader(stream), []))
    except _UNREADABLE:
        return ()


class _Lines:
    """Lines of a file but for its comments, the number of the last one, and whether that has an end."""

    def __init__(self, stream: TextIO, comment: str | None) -> None:
        self._stream, self._comment = stream, comment
        self.number = 0
        self.ended = True

    def __iter__(self) -> Iterator[str]:
        for line in self._stream:
            self.number += 1
            self.ended = line.endswith(("\n", "\r"))
            if self._comment is None or (line.strip() and not line.startswith(self._comment)):
                yield line


def read_csv(
    path: Path, error: type[PerchhwError], comment: str | None = None, may_be_torn: bool = False
) -> CsvFile:
    """Read `path`.

    Args:
        path: of the file, gzipped where it ends in ``.gz``.
        error: raised when the file is not readable as CSV, has no header, or a row whose number of cells
            differs from the header's; and by the columns of what is returned.
        comment: lines that begin so are passed over, as are lines of white space.
        may_be_torn: a last line of too few cells without an end, as of a program that was killed while it
            wrote, is left out: the lines before it are as good as ever. One that has all its cells may end
            in half a number (:meth:`CsvFile.read_as`).
    """
    rows: list[CsvRow] = []
    header: tuple[str, ...] = ()
    torn = ""
    try:
        with _open(path) as stream:
            lines = _Lines(stream, comment)
            reader = csv.reader(lines)
            header = tuple(cell.strip() for cell in next(reader, []))
            if not header:
                raise error(f"{path}: empty first row; expected a header")
            for cells in reader:
                if not cells:
                    continue
                if may_be_torn and len(cells) < len(header) and not lines.ended:
                    torn = f"row {lines.number} is cut off after {len(cells)} cells: left out"
                    continue
                if len(cells) != len(header):
                    raise error(
                        f"{path} row {lines.number}: {len(cells)} cells where the header has {len(header)}; "
                        f"the row ends in column {header[min(len(cells), len(header)) - 1]!r}"
                    )
                rows.append(CsvRow(lines.number, cells))
    except _UNREADABLE as problem:
        raise error(f"{path}: cannot be read after row {len(rows) + 1}: {problem}") from problem
    except OSError as problem:
        raise error(f"{path}: {problem.strerror or problem}; check the path") from problem
    return CsvFile(path, header, tuple(rows), error, torn, bool(lines.ended or torn) or not may_be_torn)


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Write cells that need no quotes; gzipped, without a time in it, where `path` ends in ``.gz``."""
    text = "\n".join([",".join(header), *(",".join(row) for row in rows)]) + "\n"
    if path.suffix == ".gz":
        with gzip.GzipFile(path, "wb", mtime=0) as stream:
            stream.write(text.encode())
    else:
        path.write_text(text, encoding="utf-8")


def _open(path: Path) -> TextIO:
    if path.suffix == ".gz":
        return cast(TextIO, gzip.open(path, "rt", encoding="utf-8-sig", newline=""))
    return path.open(encoding="utf-8-sig", newline="")
