"""What every scale gives: a number that grows with the load, and the line that makes a mass of it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self

import numpy as np

from calibration.bench.instruments.errors import InstrumentInputError
from calibration.measurement import Finding


@dataclass(frozen=True, slots=True)
class ScaleReading:
    """An averaged reading.

    Attributes:
        indication: mean of what the scale showed, in its unit.
        findings: what is odd about it, though it counts.
    """

    indication: float
    findings: tuple[Finding, ...] = ()


class Scale(Protocol):
    """A load cell, a balance, or a person who reads one; a context manager. Somebody else keeps the time:
    :meth:`begin`, :meth:`look` as often as wished, :meth:`read`.

    Attributes:
        unit: of what it shows: ``counts`` or ``kg``.
        least_span: in `unit`; weights of some 10 g move a scale that works by more.
        typed: a person reads it, who cannot type at the same time.
    """

    @property
    def unit(self) -> str:
        """See above."""

    @property
    def least_span(self) -> float:
        """See above."""

    @property
    def typed(self) -> bool:
        """See above."""

    @property
    def device(self) -> str:
        """Name of its port."""

    def begin(self) -> None:
        """Forget what it showed: the reading begins now."""

    def look(self, within_s: float) -> None:
        """Take in what it shows; waits up to `within_s` [s, at most 1] for something new."""

    def read(self) -> ScaleReading:
        """The mean of all that was looked at since the beginning.

        Raises:
            ScaleUnusable: nothing came, or nothing that counts.
        """

    def check(self) -> None:
        """Raise InstrumentLost when it is gone or silent; from any thread."""

    def close(self) -> None:
        """Close it; idempotent."""

    def __enter__(self) -> Self:
        """The scale itself."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close it."""


@dataclass(frozen=True, slots=True)
class ScaleCalibration:
    """Mass from what a scale shows: ``mass = (indication - zero) / per_kg``.

    Attributes:
        zero: indication without load.
        per_kg: slope; its sign is that of the mounting. 1 for a balance that is right.
        nonlinearity: largest distance of a calibration weight from the line [kg]; 0 for two points.
    """

    zero: float
    per_kg: float
    nonlinearity: float = 0.0

    @classmethod
    def fit(cls, masses: Sequence[float], indications: Sequence[float], least_span: float) -> Self:
        """The line through at least two weights.

        Args:
            masses: of the weights put on [kg], the empty scale (0) among them.
            indications: of the scale with each.
            least_span: see :class:`Scale`.

        Raises:
            InstrumentInputError: fewer than two different masses, or a scale that does not follow them.
        """
        if len(masses) != len(indications) or len(set(masses)) < 2:
            raise InstrumentInputError(
                f"a calibration needs at least two different weights with their readings; {len(masses)} "
                f"masses and {len(indications)} readings were given"
            )
        if not all(math.isfinite(value) for value in (*masses, *indications)):
            raise InstrumentInputError("a mass or a reading of the calibration is not a number")
        slope, zero = np.polyfit(masses, indications, 1)
        span = (max(masses) - min(masses)) * abs(slope)
        if span < least_span:
            raise InstrumentInputError(
                f"the scale's reading changes by {span:.2g} between the weights (at least {least_span:g} "
                "expected): does the weight rest on it, and is the load cell wired (A+ A- E+ E-)?"
            )
        error = max(abs((one - zero) / slope - mass) for mass, one in zip(masses, indications, strict=True))
        return cls(float(zero), float(slope), float(error))

    def mass(self, indication: float) -> float:
        """Mass [kg]."""
        return (indication - self.zero) / self.per_kg
