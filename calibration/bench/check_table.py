"""Tables of checks: each row has a code, a value, its limits, what it means, and what to do about it."""

from collections.abc import Iterable
from typing import NamedTuple

from calibration.measurement import Finding, Severity


class Limits(NamedTuple):
    """From where on a value is worth a word.

    Attributes:
        rising: values above a limit cross it, else those below.
        levels: limits with their severities, the worst first.
    """

    rising: bool
    levels: tuple[tuple[Severity, float], ...]

    def crossed(self, value: float | None) -> tuple[Severity, float] | None:
        """The worst limit that a value crosses; a value that is missing or not a number crosses none."""
        if value is None:
            return None
        for severity, limit in self.levels:
            if value > limit if self.rising else value < limit:
                return severity, limit
        return None


def above(*, reject: float | None = None, warning: float | None = None, note: float | None = None) -> Limits:
    """Limits that a value should not exceed."""
    return Limits(True, _levels(reject, warning, note))


def below(*, reject: float | None = None, warning: float | None = None, note: float | None = None) -> Limits:
    """Limits that a value should reach."""
    return Limits(False, _levels(reject, warning, note))


def _levels(*limits: float | None) -> tuple[tuple[Severity, float], ...]:
    severities = (Severity.REJECT, Severity.WARNING, Severity.NOTE)
    return tuple(
        (severity, limit) for severity, limit in zip(severities, limits, strict=True) if limit is not None
    )


REJECTED, WARNED, NOTED = above(reject=0.0), above(warning=0.0), above(note=0.0)
"""Of what must not be, and of counts that should be zero."""


class Check(NamedTuple):
    """A row of a table.

    Attributes:
        code: short name for scripts and tests ("few_cycles").
        value: what was measured; None where it was not.
        limits: of the value.
        meaning: what was seen, with places for value and limit as :meth:`str.format` has them.
        advice: what to do about it.
    """

    code: str
    value: float | None
    limits: Limits
    meaning: str
    advice: str


def findings_of(place: str, table: Iterable[Check]) -> list[Finding]:
    """What a table finds, in its order; each text begins with `place`, the recording it is about."""
    findings = []
    for row in table:
        crossed = row.limits.crossed(row.value)
        if crossed is not None:
            severity, limit = crossed
            text = f"{row.meaning.format(row.value, limit)}; {row.advice}"
            findings.append(Finding(row.code, severity, f"{place}: {text}" if place else text))
    return findings
