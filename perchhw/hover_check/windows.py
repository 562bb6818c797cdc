"""The parts of a check's record: rest before arming, hover, and the doublets after it."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from onboard.arrays import FloatArray
from perchhw.errors import FlightStackError
from perchhw.record import RunRecord

SETTLING_S = 2.0
"""s after arrival at the place of the hover that are left out: the last move swings."""
MOTORS: Final = ("m1", "m2", "m3", "m4")


class RecordTooShort(FlightStackError):
    """A record that does not hold what the check needs; the message says which topic."""


@dataclass(frozen=True)
class CheckWindows:
    """The spans of a record, each begin and end in s on the record's clock.

    Attributes:
        run: the record.
        rest: motors off, before arming.
        hover: in one place.
        doublets: quick small tilts to all sides.
    """

    run: RunRecord
    rest: tuple[float, float]
    hover: tuple[float, float]
    doublets: tuple[float, float]

    @classmethod
    def of(cls, run: RunRecord, seconds: float, duration: float) -> "CheckWindows":
        """The spans of a course of `duration` (s) that begins with `seconds` of hover.

        Raises:
            RecordTooShort: the course was never begun.
        """
        begins = {e["phase"]: float(e["t"]) for e in reversed(run.events) if e["event"] == "phase"}
        if "arming" not in begins or "test flight" not in begins:
            raise RecordTooShort(f"{run.folder}: has no test flight in it; fly the check again")
        begin = begins["test flight"]
        return cls(
            run,
            rest=(0.0, begins["arming"]),
            hover=(begin + min(SETTLING_S, 0.5 * seconds), begin + seconds),
            doublets=(begin + seconds, begin + duration),
        )

    def columns(self, topic: str, span: tuple[float, float], *names: str) -> tuple[FloatArray, FloatArray]:
        """Times (n,) and values (n, len(names)) of the rows in `span` that have all of them.

        Raises:
            RecordTooShort: fewer than two rows.
        """
        series = self.run.series.get(topic)
        if series is None:
            raise RecordTooShort(f"{self.run.folder}: has no {topic}; fly the check again")
        values = np.column_stack([series.numbers(name) for name in names])
        rows = (series.t >= span[0]) & (series.t <= span[1]) & np.isfinite(values).all(axis=1)
        if rows.sum() < 2:
            raise RecordTooShort(f"{self.run.folder}: has too little of {topic}; fly the check again")
        return series.t[rows], values[rows]

    def on_grid(
        self, span: tuple[float, float], dt: float, *asked: tuple[str, tuple[str, ...]]
    ) -> list[FloatArray]:
        """Values of several topics at the same instants, `dt` (s) apart on the drone's own clock.

        Args:
            span: begin and end, s on the record's clock.
            dt: s.
            asked: topic and names of its fields, each.

        Returns:
            Values (n, len(names)) for each topic, linear between what came.
        """
        rows = [self.columns(topic, span, *names, "drone_time_ms")[1] for topic, names in asked]
        begin, end = max(one[0, -1] for one in rows), min(one[-1, -1] for one in rows)
        grid = np.arange(begin, end + 0.5, 1e3 * dt)
        return [
            np.column_stack([np.interp(grid, one[:, -1], column) for column in one[:, :-1].T]) for one in rows
        ]


def mean_of(values: FloatArray, blocks: int = 8) -> tuple[float, float]:
    """Mean of a series (n,) and its standard error from the scatter of block means, which no correlation
    shorter than a block makes too small."""
    means = np.array([part.mean() for part in np.array_split(values, blocks)])
    return float(values.mean()), float(means.std(ddof=1) / np.sqrt(blocks))
