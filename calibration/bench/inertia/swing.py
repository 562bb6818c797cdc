"""One recording of a bifilar swing, and its time made usable."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from calibration.bench.inertia.errors import UnusableSwingError
from calibration.measurement import Finding, Severity
from onboard.arrays import FloatArray, Vector

CLOCK_WRAP_S = 2**24 * 1e-3
"""s, after which the stamps of the Crazyflie's log blocks (24 bits of ms) start again."""

_BACKWARDS_LIMIT = 0.01  # share of rows out of order above which nothing about the time can be trusted


@dataclass(frozen=True, slots=True, eq=False)
class Swing:
    """One recording of a drone that turns between two strings.

    Attributes:
        time: s, (n,), as stamped; it may wrap (see :data:`CLOCK_WRAP_S`) and need not start at zero.
        gyro: rad/s, (n, 3), body frame.
        source: where it comes from, for messages ("trial-2.csv").
        acceleration: specific force, m/s2, (n, 3), body frame, or None.
        clock: who stamped the rows: the drone, or the host when they arrived (3-10 ms of jitter).
        axis: the body axis that the operator says hangs vertical, or None.

    Raises:
        UnusableSwingError: shapes that do not agree, or a value that is not finite (the row is named).
    """

    time: FloatArray
    gyro: FloatArray
    source: str
    acceleration: FloatArray | None = None
    clock: Literal["drone", "host"] = "drone"
    axis: Vector | None = None

    def __post_init__(self) -> None:
        n = len(self.time)
        for name, values, shape in (
            ("time", self.time, (n,)),
            ("gyro", self.gyro, (n, 3)),
            ("acceleration", self.acceleration, (n, 3)),
        ):
            if values is None:
                continue
            if values.shape != shape:
                raise UnusableSwingError(f"{self.source}: {name} has shape {values.shape}, expected {shape}")
            finite = np.isfinite(values if values.ndim == 1 else values.sum(axis=1))
            if not finite.all():
                row = int(np.argmin(finite))
                raise UnusableSwingError(f"{self.source}: {name} of sample {row} is not finite; record again")
        if self.axis is not None and not math.hypot(*self.axis) > 0.0:
            raise UnusableSwingError(f"{self.source}: the claimed axis has no direction; give e.g. (0, 0, 1)")

    def __len__(self) -> int:
        return len(self.time)

    def between(self, first: float, last: float) -> "Swing":
        """The samples with `first` <= time <= `last` (s)."""
        chosen = (self.time >= first) & (self.time <= last)
        acceleration = None if self.acceleration is None else self.acceleration[chosen]
        return replace(self, time=self.time[chosen], gyro=self.gyro[chosen], acceleration=acceleration)

    def about(self, axis: Vector) -> "Swing":
        """The same recording with the body axis that the operator says hangs vertical."""
        return replace(self, axis=axis)


def in_order(swing: Swing) -> tuple[Swing, list[Finding]]:
    """The recording with time that only rises, and what had to be done for it.

    Wraps of the 24-bit clock are undone. A row whose time does not exceed every earlier one is left out.
    """
    findings: list[Finding] = []
    step = np.diff(swing.time, prepend=swing.time[:1])
    wraps = np.cumsum(step < -0.5 * CLOCK_WRAP_S)
    time = swing.time + CLOCK_WRAP_S * wraps
    if wraps.size and wraps[-1]:
        findings.append(
            Finding(
                "clock_wrap",
                Severity.NOTE,
                f"{swing.source}: the drone's 24-bit ms clock wrapped {wraps[-1]} time(s); undone",
            )
        )
    highest = np.maximum.accumulate(time) if time.size else time
    forward = np.ones(len(time), dtype=bool)
    forward[1:] = time[1:] > highest[:-1]
    lost = int(np.count_nonzero(~forward))
    if lost:
        share = lost / len(time)
        findings.append(
            Finding(
                "time_not_monotone",
                Severity.REJECT if share > _BACKWARDS_LIMIT else Severity.WARNING,
                f"{swing.source}: {lost} row(s) ({share:.1%}, limit {_BACKWARDS_LIMIT:.0%}) have a time that "
                f"repeats or goes back, first row {int(np.argmin(forward))}; left out. "
                "Log with the stamps of the drone, one writer per file",
            )
        )
    acceleration = None if swing.acceleration is None else swing.acceleration[forward]
    ordered = replace(swing, time=time[forward], gyro=swing.gyro[forward], acceleration=acceleration)
    return ordered, findings
