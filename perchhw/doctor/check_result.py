"""One line of the doctor's: what was measured, what is wanted and why, and what to do."""

from dataclasses import dataclass
from enum import Enum


class CheckVerdict(Enum):
    """What is said of one thing."""

    FINE = "fine"
    NOTE = "note"  # not known to us, but nothing that is needed is missing
    BAD = "bad"
    UNKNOWN = "unknown"  # could not be measured, which is never good


@dataclass(frozen=True, slots=True)
class CheckResult:
    """One line.

    Attributes:
        what: name of the check.
        verdict: fine or not.
        measured, wanted: in words, with units.
        why: what it is needed for.
        remedy: what to do; None where all is fine.
    """

    what: str
    verdict: CheckVerdict
    measured: str
    wanted: str
    why: str
    remedy: str | None = None

    @property
    def missing(self) -> bool:
        """Whether a flight lacks it."""
        return self.verdict in (CheckVerdict.BAD, CheckVerdict.UNKNOWN)


def judged(what: str, fine: bool, measured: str, wanted: str, why: str, remedy: str) -> CheckResult:
    """FINE, or BAD with its remedy."""
    if fine:
        return CheckResult(what, CheckVerdict.FINE, measured, wanted, why)
    return CheckResult(what, CheckVerdict.BAD, measured, wanted, why, remedy)


def not_known(what: str, reason: str, wanted: str, why: str, remedy: str) -> CheckResult:
    """UNKNOWN, with the reason in the place of the measured value."""
    return CheckResult(what, CheckVerdict.UNKNOWN, reason, wanted, why, remedy)
