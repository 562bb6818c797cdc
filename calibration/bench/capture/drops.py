"""Tables of drops: how fast a foot met the board, and whether it stuck.

One row a drop, or one row a speed:

    speed_m_s,stuck                     speed_m_s,thrown,stuck
    0.4,no                              0.4,20,3
    0.8,yes                             0.8,20,15

`height_m`, from which a leg falls freely onto the board, may stand in the place of `speed_m_s`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calibration.bench.capture.errors import DropTableError
from onboard.arrays import FloatArray, IntArray
from onboard.csv_file import CsvFile, read_csv
from onboard.gravity import GRAVITY

FASTEST = 10.0
"""m/s: nobody throws a leg faster; such numbers are in another unit."""

_ANSWERS = {"yes": 1, "no": 0, "1": 1, "0": 0, "true": 1, "false": 0}


@dataclass(frozen=True)
class Drops:
    """Counts by speed.

    Attributes:
        name: of the table, for messages.
        speed: (k,) m/s, rising: of the foot along the board's normal when it touches.
        thrown: (k,) drops at that speed.
        stuck: (k,) how many of them held.
    """

    name: str
    speed: FloatArray
    thrown: IntArray
    stuck: IntArray

    @classmethod
    def of(cls, name: str, speed: FloatArray, thrown: IntArray, stuck: IntArray) -> "Drops":
        """Rows in any order; those of one speed are added up."""
        speeds, row = np.unique(speed, return_inverse=True)
        counts = [np.bincount(row, weights=one, minlength=speeds.size) for one in (thrown, stuck)]
        return cls(name, speeds, counts[0].astype(np.int64), counts[1].astype(np.int64))

    @property
    def separated(self) -> bool:
        """Whether every drop that stuck was faster than every one that did not, and there are both."""
        held, fell = self.speed[self.stuck > 0], self.speed[self.stuck < self.thrown]
        return bool(held.size and fell.size and held.min() > fell.max())

    def rows(self) -> list[dict[str, Any]]:
        """As JSON: ``{speed_m_s, thrown, stuck}``."""
        columns = zip(self.speed, self.thrown, self.stuck, strict=True)
        return [{"speed_m_s": float(v), "thrown": int(n), "stuck": int(k)} for v, n, k in columns]


def fall_height(speed: float) -> float:
    """Height (m) of a free fall that ends at `speed` (m/s)."""
    return speed * speed / (2.0 * GRAVITY)


def read_drops(path: Path) -> Drops:
    """Read a table; lines that begin with # are passed over.

    Raises:
        DropTableError: not readable, without drops, or a cell that cannot be.
    """
    table = read_csv(path, DropTableError, comment="#")
    if not table.rows:
        raise DropTableError(f"{path}: no drops below the header")
    speed = _speeds(table)
    if "thrown" not in table.header:
        stuck = np.array([_answer(table, index) for index in range(len(table.rows))], dtype=np.int64)
        return Drops.of(path.name, speed, np.ones_like(stuck), stuck)
    thrown, stuck = table.integers("thrown"), table.integers("stuck")
    for name, wrong, what in (
        ("thrown", thrown < 1, "at least one drop a row"),
        ("stuck", (stuck < 0) | (stuck > thrown), "between none and all that were thrown"),
    ):
        for index in np.flatnonzero(wrong)[:1]:
            row = table.rows[index]
            raise table.problem(row, name, f"{row.cells[table.index(name)].strip()!r}; must be {what}")
    return Drops.of(path.name, speed, thrown, stuck)


def _speeds(table: CsvFile) -> FloatArray:
    """(rows,) m/s."""
    named = [name for name in ("speed_m_s", "height_m") if name in table.header]
    if len(named) != 1:
        raise DropTableError(
            f"{table.path}: one column 'speed_m_s' or 'height_m' is needed; found {', '.join(table.header)}"
        )
    value = table.finite(named[0])
    speed = value if named[0] == "speed_m_s" else np.sqrt(2.0 * GRAVITY * np.maximum(value, 0.0))
    for index in np.flatnonzero((value <= 0.0) | (speed > FASTEST))[:1]:
        raise table.problem(
            table.rows[index],
            named[0],
            f"{value[index]:g} gives {speed[index]:.3g} m/s, not 0 to {FASTEST:g}; is it in SI units?",
        )
    return speed


def _answer(table: CsvFile, index: int) -> int:
    text = table.text("stuck")[index].lower()
    if text not in _ANSWERS:
        hint = "; counts need a column 'thrown'" if text.isdigit() else ""
        raise table.problem(table.rows[index], "stuck", f"{text!r} is neither yes nor no{hint}")
    return _ANSWERS[text]
