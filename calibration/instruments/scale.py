"""What every scale gives: a mass with its scatter, averaged over a time."""

from dataclasses import dataclass
from typing import Protocol

from calibration.measurement import Finding


@dataclass(frozen=True, slots=True)
class MassReading:
    """An averaged reading.

    Attributes:
        mass: mean [kg].
        deviation: standard deviation of the single readings [kg]; 0 for a single one.
        readings: how many were averaged.
        start, end: host clock [s].
        findings: what is wrong with them; a rejected reading is kept but does not count.
    """

    mass: float
    deviation: float
    readings: int
    start: float
    end: float
    findings: tuple[Finding, ...]


class Scale(Protocol):
    """A load cell, a balance, or a person who reads one."""

    def tare(self, seconds: float) -> None:
        """Call the present load zero."""
        ...

    def average(self, seconds: float) -> MassReading:
        """Mean over `seconds` [s]."""
        ...

    def close(self) -> None:
        """Close it; idempotent."""
        ...
