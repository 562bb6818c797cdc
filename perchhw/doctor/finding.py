"""One line of the doctor's: what was measured, what is wanted and why, and what to do."""

from dataclasses import dataclass
from enum import Enum
from typing import Any


class CheckVerdict(Enum):
    """What is said of one thing."""

    FINE = "fine"
    NOTE = "note"  # not known to us, but nothing that is needed is missing
    BAD = "bad"
    UNKNOWN = "unknown"  # could not be measured, which is never good


@dataclass(frozen=True, slots=True)
class Finding:
    """One line.

    Attributes:
        what: name of the check.
        verdict: fine or not.
        measured, wanted: in words, with units.
        why: what it is needed for.
        remedy: what to do; empty where all is fine.
    """

    what: str
    verdict: CheckVerdict
    measured: str
    wanted: str
    why: str
    remedy: str = ""

    @property
    def missing(self) -> bool:
        """Whether a flight lacks it."""
        return self.verdict in (CheckVerdict.BAD, CheckVerdict.UNKNOWN)

    def to_json(self) -> dict[str, Any]:
        """The line in the JSON document."""
        return {
            "what": self.what,
            "verdict": self.verdict.value,
            "measured": self.measured,
            "wanted": self.wanted,
            "why": self.why,
            "remedy": self.remedy or None,
        }


def judged(what: str, fine: bool, measured: str, wanted: str, why: str, remedy: str) -> Finding:
    """FINE, or BAD with its remedy."""
    if fine:
        return Finding(what, CheckVerdict.FINE, measured, wanted, why)
    return Finding(what, CheckVerdict.BAD, measured, wanted, why, remedy)


def not_known(what: str, reason: str, wanted: str, why: str, remedy: str) -> Finding:
    """UNKNOWN, with the reason in the place of the measured value."""
    return Finding(what, CheckVerdict.UNKNOWN, reason, wanted, why, remedy)
