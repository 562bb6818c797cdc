"""A check's figures, held against the vehicle file and against the days before.

Against the file: E_n = |m - e| / sqrt(U_m^2 + U_e^2) of two 95 % uncertainties (ISO 13528); above 1 they
contradict each other. Against the days: a control chart for single values whose spread is pooled from the
days and from the repeatability that is known beforehand (weight of ten days),

    |x - mean| <= t(0.99865; nu + n - 1) s sqrt(1 + 1/n),  s^2 = (nu r^2 + sum (x_i - mean)^2) / (nu + n - 1)

so that two days are enough to ask, and twenty to answer by the drone's own scatter. The quantile is that of
Shewhart's three standard deviations (1931).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
from scipy.special import stdtrit

from calibration.measurement import Estimate, normalised_difference
from perchhw.diagnosis.busy import REMEDY
from perchhw.hover_check.quantities import HELD, HeldQuantity

KNOWN_DAYS = 10
_QUANTILE = 0.99865


class LineVerdict(Enum):
    """What is said of one quantity."""

    SAME = "same"
    CHANGED = "changed"  # from the days before
    OFF_FILE = "off_file"  # as on the days before, or there are none; not as the vehicle file says
    NOTE = "note"  # nothing to hold it against yet


@dataclass(frozen=True, slots=True)
class Days:
    """Control limits from the days before: lowest and highest value, their mean, and how many."""

    low: float
    high: float
    mean: float
    checks: int


@dataclass(frozen=True, slots=True)
class CheckedQuantity:
    """One quantity of a check.

    Attributes:
        held: which.
        measured: today.
        expected: by the vehicle file; None: it does not say.
        ratio: E_n; None without `expected`.
        days: None without days before.
        verdict: what comes of it.
        busy: how busy this computer was, where that can be the reason; None: it was not, or cannot be.
    """

    held: HeldQuantity
    measured: Estimate
    expected: Estimate | None
    ratio: float | None
    days: Days | None
    verdict: LineVerdict
    busy: str | None = None

    @property
    def settles(self) -> str | None:
        """What settles it, where it is not as it was or should be."""
        if self.verdict not in (LineVerdict.CHANGED, LineVerdict.OFF_FILE):
            return None
        return self.held.settles if self.busy is None else f"{self.busy}; {REMEDY}; else {self.held.settles}"

    def json_shape(self) -> dict[str, Any]:
        """The line in the JSON document; SI."""
        return {
            "what": self.held.what,
            "meaning": self.held.meaning,
            "measured": self.measured,
            "expected": self.expected,
            "ratio": self.ratio,
            "days": self.days,
            "verdict": self.verdict,
            "settles": self.settles,
        }


def judge(
    measured: Mapping[str, Estimate],
    expected: Mapping[str, Estimate],
    before: Sequence[Mapping[str, float]],
    busy: str | None = None,
) -> tuple[CheckedQuantity, ...]:
    """A line for each held quantity that was measured.

    Args:
        measured, expected: by name of the quantity.
        before: values by name of earlier checks of the same drone.
        busy: how this computer was too busy for the flight, in words; None: it was not.
    """
    lines = (
        _line(held, measured[held.what], expected.get(held.what), before)
        for held in HELD
        if held.what in measured
    )
    return tuple(replace(line, busy=busy if line.held.late_with_computer else None) for line in lines)


def _line(
    held: HeldQuantity,
    measured: Estimate,
    expected: Estimate | None,
    before: Sequence[Mapping[str, float]],
) -> CheckedQuantity:
    ratio = None if expected is None else normalised_difference(measured, expected)
    values = np.array([one[held.what] for one in before if held.what in one])
    days = against_days(held, values) if len(values) else None
    above = expected is None or measured.value > expected.value
    if days is not None and (
        measured.value > days.high or (measured.value < days.low and not held.more_is_wrong)
    ):
        verdict = LineVerdict.CHANGED
    elif ratio is not None and ratio > 1.0 and (above or not held.more_is_wrong):
        verdict = LineVerdict.OFF_FILE
    elif ratio is None and days is None:
        verdict = LineVerdict.NOTE
    else:
        verdict = LineVerdict.SAME
    return CheckedQuantity(held, measured, expected, ratio, days, verdict)


def against_days(held: HeldQuantity, values: np.ndarray) -> Days:
    """Control limits for the next value after `values` (n,), n >= 1."""
    count, mean = len(values), float(values.mean())
    repeats = held.repeats * (abs(mean) if held.relative else 1.0)
    freedom = KNOWN_DAYS + count - 1
    variance = (KNOWN_DAYS * repeats**2 + float(((values - mean) ** 2).sum())) / freedom
    reach = float(stdtrit(freedom, _QUANTILE)) * np.sqrt(variance * (1.0 + 1.0 / count))
    return Days(mean - reach, mean + reach, mean, count)


def in_words(lines: Sequence[CheckedQuantity], last_day: str | None) -> str:
    """The morning's answer in one sentence."""
    changed = [line.held.what for line in lines if line.verdict is LineVerdict.CHANGED]
    off = [line.held.what for line in lines if line.verdict is LineVerdict.OFF_FILE]
    asked = [line for line in lines if line.settles is not None]
    if asked and (busy := asked[0].busy) is not None and all(line.busy is not None for line in asked):
        return f"not to be judged, {busy}: {', '.join(line.held.what for line in asked)}"
    if changed:
        return f"not the drone of {last_day}: {', '.join(changed)} changed"
    if off and last_day is not None:
        return f"the same drone as on {last_day}, but not as its vehicle file says: {', '.join(off)}"
    if off:
        return f"not as its vehicle file says: {', '.join(off)}"
    if last_day is None:
        return "as its vehicle file says; there is no earlier check to hold it against"
    return f"the same drone as on {last_day}"
