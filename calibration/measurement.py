"""What a measurement on the bench says: estimates with uncertainty, budgets, and findings in plain words.

Uncertainty follows the GUM (JCGM 100:2008): a standard uncertainty with degrees of freedom, an expanded one
with the 95 % factor of Student's t, contributions listed so that the largest can be seen.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Self

import numpy as np

from onboard.arrays import FloatArray, IntArray
from onboard.quantity import Quantity

COVERAGE = 0.95

Interval = tuple[float, float]
"""Low and high end of a 95 % interval."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A measured number.

    Attributes:
        value: best estimate, in `unit`.
        unit: as in vehicle files ("kg m2", "s").
        sigma: standard uncertainty (k = 1), in `unit`.
        dof: effective degrees of freedom of `sigma`; infinite when it is known.
        half_width: part of `sigma`, in `unit`: the instrument may be off by up to this, evenly spread, the
            same in each reading.
        half_interval: half the width of a 95 % interval that was drawn instead of taken from `sigma`;
            infinite where none is claimed.
    """

    value: float
    unit: str
    sigma: float
    dof: float = math.inf
    half_width: float = 0.0
    half_interval: float | None = None

    @classmethod
    def from_quantity(cls, quantity: Quantity) -> Self:
        """What a vehicle file says."""
        return cls(quantity.value, quantity.unit, quantity.sigma)

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """The estimate that :meth:`document` described, with the interval that it had."""
        return cls(
            value=float(document["value"]),
            unit=str(document["unit"]),
            sigma=float(document["sigma"]),
            dof=_or_infinite(document["dof"]),
            half_interval=_or_infinite(document["u95"]),
        )

    @property
    def u95(self) -> float:
        """Expanded uncertainty, in `unit`: half the width of the 95 % interval; infinite below one dof."""
        return coverage_factor(self.dof) * self.sigma if self.half_interval is None else self.half_interval

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.value - self.u95, self.value + self.u95

    def json_shape(self) -> dict[str, Any]:
        """``{value, unit, u95}``; `u95` is None when nobody can say."""
        return {"value": self.value, "unit": self.unit, "u95": self.u95 if math.isfinite(self.u95) else None}

    def document(self) -> dict[str, Any]:
        """``{value, unit, u95, sigma, dof}``: all that is needed to read it back; None for infinite."""
        return {**self.json_shape(), "sigma": self.sigma, "dof": self.dof if self.dof < 1e9 else None}

    def quantity(self, source: str) -> Quantity:
        """As vehicle files have it, with `source` as provenance."""
        return Quantity(self.value, self.unit, self.sigma, source)

    def draw(self, rng: np.random.Generator, n: int) -> FloatArray:
        """`n` possible errors, in `unit` (GUM Supplement 1): even for the instrument, t for the rest."""
        even = self.half_width**2 / 3.0
        if even == 0.0:
            return self.sigma * student(rng, self.dof, n)
        scatter2 = max(self.sigma**2 - even, 0.0)
        # The degrees of freedom of the scatter alone, undoing what the exact half width added.
        scatter_dof = self.dof * (scatter2 / self.sigma**2) ** 2
        return rng.uniform(-self.half_width, self.half_width, n) + math.sqrt(scatter2) * student(
            rng, scatter_dof, n
        )

    def __str__(self) -> str:
        """In words: ``1.70e-05 ± 1.1e-07 kg m2``."""
        uncertainty = f"{self.u95:.2g}" if math.isfinite(self.u95) else "not known"
        return f"{self.value:.5g} ± {uncertainty} {self.unit}"


def _or_infinite(raw: Any) -> float:
    return math.inf if raw is None else float(raw)


def student(rng: np.random.Generator, dof: float, n: int) -> FloatArray:
    """`n` draws of Student's t; normal for infinite `dof`."""
    return rng.standard_normal(n) if not math.isfinite(dof) else rng.standard_t(max(dof, 1.0), n)


def coverage_factor(dof: float) -> float:
    """The factor that makes a standard uncertainty cover 95 %: Student's t, 1.96 for infinite dof."""
    if dof < 1.0:
        return math.inf
    from scipy.special import stdtrit  # takes as long to import as all the rest of a flight's program

    return float(stdtrit(min(dof, 1e9), 0.5 + 0.5 * COVERAGE))


@dataclass(frozen=True, slots=True)
class Contribution:
    """One line of an uncertainty budget.

    Attributes:
        name: of the input, in the operator's words ("string distance").
        share: standard uncertainty of the result that this input causes, relative to the result.
        dof: degrees of freedom of the input.
        advice: what would make it smaller.
    """

    name: str
    share: float
    dof: float = math.inf
    advice: str = ""


def combine(contributions: Sequence[Contribution]) -> tuple[float, float]:
    """Relative standard uncertainty and effective degrees of freedom (Welch-Satterthwaite, GUM G.4)."""
    total = math.sqrt(sum(one.share**2 for one in contributions))
    if total == 0.0:
        return 0.0, math.inf
    spread = sum(one.share**4 / one.dof for one in contributions)
    return total, (total**4 / spread if spread > 0.0 else math.inf)


def normalised_difference(first: Estimate, second: Estimate) -> float | None:
    """E_n of two estimates of one quantity in one unit: above 1 they contradict each other (ISO 13528).

    None where nobody knows how far off one of them may be: nothing agrees with it, nor contradicts it.
    """
    width = math.hypot(first.u95, second.u95)
    difference = abs(first.value - second.value)
    if not math.isfinite(width):
        return None
    if width == 0.0:
        return 0.0 if difference == 0.0 else math.inf
    return difference / width


class Severity(Enum):
    """How bad a finding is."""

    NOTE = "note"
    WARNING = "warning"
    REJECT = "reject"


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that a check of recorded data has seen.

    Attributes:
        code: short name for scripts and tests ("few_cycles").
        severity: a rejected recording is kept but does not count.
        text: what was seen, with the figure and its limit, and what to do about it.
    """

    code: str
    severity: Severity
    text: str


def rejected(findings: Sequence[Finding]) -> bool:
    """Whether one of the findings rejects the recording."""
    return any(finding.severity is Severity.REJECT for finding in findings)


def interval_of(drawn: FloatArray) -> Interval:
    """The middle 95 % of what was drawn, shape (n,)."""
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(low), float(high)


def drawn_again(count: int, sets: int, rng: np.random.Generator) -> IntArray:
    """Indices (sets, count) of flights or landings, drawn from `count` with replacement: the bootstrap."""
    return rng.integers(0, count, (sets, count))


def wilson_interval(successes: int, trials: int) -> Interval:
    """95 % interval of a rate (Wilson 1927): stays within 0 and 1 also for few trials."""
    z = 1.959964
    centre = (successes + z * z / 2) / (trials + z * z)
    half = z / (trials + z * z) * math.sqrt(successes * (trials - successes) / trials + z * z / 4)
    return max(0.0, centre - half), min(1.0, centre + half)
