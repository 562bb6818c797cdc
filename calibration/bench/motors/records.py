"""What a tachometer delivers: times of edges, or speeds averaged over windows; and the commands beside it."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calibration.bench.motors.errors import TachometerError
from onboard.arrays import FloatArray

IntArray = NDArray[np.int64]

TYPICAL_JITTER = 3e-6
"""s: optical edge through an interrupt, with the 4 us tick of an Uno's micros() (bench notes 1.2)."""


@dataclass(frozen=True, slots=True)
class EdgeRecord:
    """Times at which a mark passed the sensor.

    Attributes:
        times: (n,) s, clock of the instrument.
        counts: (n,) number of edges the instrument has seen up to and including this one. Where it rises by
            more than one, edges were lost on the line, and it is known how many.
        name: of the recording, for messages.
    """

    times: FloatArray
    counts: IntArray
    name: str = "recording"

    def __post_init__(self) -> None:
        if self.times.shape != self.counts.shape or self.times.ndim != 1:
            raise TachometerError(f"{self.name}: {self.times.size} times for {self.counts.size} edge counts")
        if not np.all(np.isfinite(self.times)):
            raise TachometerError(f"{self.name}: a time that is not a number; record it again")

    @property
    def measured(self) -> tuple[FloatArray, ...]:
        """The numbers that tell this recording from any other."""
        return self.times, self.counts.astype(np.float64)

    def scaled(self, scale: float) -> "EdgeRecord":
        """With times multiplied by `scale`, the true second over that of the instrument."""
        return replace(self, times=self.times * scale)

    def parts(self) -> list["EdgeRecord"]:
        """Stretches in which neither the clock nor the count goes back (an instrument that resets does)."""
        backward = (np.diff(self.times) <= 0.0) | (np.diff(self.counts) <= 0)
        bounds = [0, *(np.flatnonzero(backward) + 1), self.times.size]
        return [
            EdgeRecord(self.times[first:last], self.counts[first:last], self.name)
            for first, last in pairwise(bounds)
        ]


@dataclass(frozen=True, slots=True)
class WindowRecord:
    """Speeds that the instrument averaged itself, by counting marks in a window (the authors' logs).

    Attributes:
        ends: (n,) s, end of each window; a window begins where the one before ends.
        speeds: (n,) rad/s.
        marks: marks per revolution that the instrument reckoned with.
        name: of the recording, for messages.
    """

    ends: FloatArray
    speeds: FloatArray
    marks: int = 2
    name: str = "recording"

    def __post_init__(self) -> None:
        if self.ends.shape != self.speeds.shape or self.ends.ndim != 1 or self.ends.size < 2:
            raise TachometerError(f"{self.name}: {self.ends.size} times for {self.speeds.size} speeds")
        if not np.all(np.isfinite(self.ends)) or not np.all(np.isfinite(self.speeds)):
            raise TachometerError(f"{self.name}: a time or speed that is not a number; record it again")
        if np.any(np.diff(self.ends) <= 0.0):
            row = int(np.flatnonzero(np.diff(self.ends) <= 0.0)[0]) + 1
            raise TachometerError(f"{self.name}: time goes back at sample {row}; cut the recording there")
        if np.any(self.speeds < 0.0):
            raise TachometerError(f"{self.name}: a negative speed; a count of marks cannot give one")

    @property
    def measured(self) -> tuple[FloatArray, ...]:
        """The numbers that tell this recording from any other."""
        return self.ends, self.speeds

    @property
    def window(self) -> float:
        """Typical length of a window, s."""
        return float(np.median(np.diff(self.ends)))


@dataclass(frozen=True, slots=True)
class CommandRecord:
    """Motor commands on the clock of the instrument (its echo of host marks).

    Attributes:
        times: (n,) s.
        commands: (n,) 16-bit motor commands, 0..65535.
    """

    times: FloatArray
    commands: FloatArray


@dataclass(frozen=True, slots=True)
class SpeedTrace:
    """Mean speeds over stretches of time that do not overlap.

    Attributes:
        start, end: (n,) s.
        speed: (n,) rad/s, angle turned between `start` and `end` over the time.
        sigma: (n,) rad/s, what the instrument alone makes uncertain (k = 1).
        resolution: s, length of a stretch where the speed is high: detail below it is lost.
        name: of the recording.
    """

    start: FloatArray
    end: FloatArray
    speed: FloatArray
    sigma: FloatArray
    resolution: float
    name: str


def trace_of_windows(record: WindowRecord) -> SpeedTrace:
    """The trace of a window-averaged recording; one mark more or less is what it cannot tell."""
    length = np.diff(record.ends)
    quantum = 2.0 * np.pi / (record.marks * length)
    return SpeedTrace(
        start=record.ends[:-1],
        end=record.ends[1:],
        speed=record.speeds[1:],
        sigma=quantum / np.sqrt(12.0),
        resolution=record.window,
        name=record.name,
    )
