"""What a measurement on the bench says: estimates with uncertainty, budgets, and findings in plain words.

Uncertainty follows the GUM (JCGM 100:2008): a standard uncertainty with degrees of freedom, an expanded one
with the 95 % factor of Student's t, contributions listed so that the largest can be seen.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from scipy.special import stdtrit

COVERAGE = 0.95


@dataclass(frozen=True, slots=True)
class Estimate:
    """A measured number.

    Attributes:
        value: best estimate, in `unit`.
        unit: as in vehicle files ("kg m2", "s").
        sigma: standard uncertainty (k = 1), in `unit`.
        dof: effective degrees of freedom of `sigma`; infinite when it is known.
    """

    value: float
    unit: str
    sigma: float
    dof: float = math.inf

    @property
    def u95(self) -> float:
        """Expanded uncertainty, in `unit`: half the width of the 95 % interval; infinite below one dof."""
        return coverage_factor(self.dof) * self.sigma

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval."""
        return self.value - self.u95, self.value + self.u95

    def to_json(self) -> dict[str, Any]:
        """``{value, unit, u95}``; `u95` is None when nobody can say."""
        return {"value": self.value, "unit": self.unit, "u95": self.u95 if math.isfinite(self.u95) else None}


@dataclass(frozen=True, slots=True)
class DrawnEstimate(Estimate):
    """An estimate whose interval was drawn instead of taken from `sigma`.

    Attributes:
        half_interval: half the width of the 95 % interval; infinite where none is claimed.
    """

    half_interval: float = math.inf

    @property
    def u95(self) -> float:
        """Half the width of the drawn 95 % interval."""
        return self.half_interval


def coverage_factor(dof: float) -> float:
    """The factor that makes a standard uncertainty cover 95 %: Student's t, 1.96 for infinite dof."""
    if dof < 1.0:
        return math.inf
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


def normalised_difference(first: Estimate, second: Estimate) -> float:
    """E_n of two estimates of one quantity in one unit: above 1 they contradict each other (ISO 13528)."""
    width = math.hypot(first.u95, second.u95)
    difference = abs(first.value - second.value)
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

    def to_json(self) -> dict[str, str]:
        """``{code, severity, text}``."""
        return {"code": self.code, "severity": self.severity.value, "text": self.text}


def rejected(findings: Sequence[Finding]) -> bool:
    """Whether one of the findings rejects the recording."""
    return any(finding.severity is Severity.REJECT for finding in findings)
