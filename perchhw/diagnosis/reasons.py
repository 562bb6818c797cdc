"""Reasons for the end of a flight that are no rule with a limit, and the kind of thing behind any reason."""

from typing import Final

from mocap_bridge.errors import MocapError
from onboard.errors import PerchhwError
from onboard.link.errors import LinkError
from perchhw.diagnosis.finding import Cause
from perchhw.diagnosis.rules import KIND_OF_RULE, RULES, AbortKind, RuleWords

_REASONS: Final[dict[AbortKind, dict[str, RuleWords | None]]] = {
    AbortKind.LINK: {
        "link_lost": RuleWords(
            Cause.LINK_LOST, "the link to the drone was lost ({})", RULES["link_lost"].next
        ),
    },
    AbortKind.MOCAP: {"pose": None, "drone_broke_off: pose": None},
    AbortKind.DRONE: {
        "drone_state: locked": RuleWords(
            Cause.STOPPED_BY_OTHERS,
            "the drone is locked, as after every flight and every stop",
            "if it was stopped, find out why; then put it back on its mark and reboot it (--put-back)",
        ),
        "drone_broke_off": None,
        "the drone did not arm within": RuleWords(
            Cause.NOT_READY, "the drone did not arm", "perchhw doctor --drone URI"
        ),
        "the drone": None,
        "policy upload": None,
        "disarming: the drone did not confirm": RuleWords(
            Cause.LINK_LOST, "the drone did not confirm that it was disarmed", RULES["link_lost"].next
        ),
        "stop_unconfirmed": RuleWords(
            Cause.LINK_LOST,
            "the stop was not confirmed ({})",
            "keep away from the drone and cut its power",
        ),
    },
    AbortKind.PATH: {
        "fence_": None,
        "no steady hover": RuleWords(
            Cause.START_NOT_REACHED,
            "the drone never hovered steadily after take-off",
            "look at thrust, pack and mocap",
        ),
        "the start of the approach was not reached": RuleWords(
            Cause.START_NOT_REACHED,
            "the drone never hovered steadily at the start of the approach",
            "look at hover and mocap: what moves the drone?",
        ),
        "the approach": None,
        "the course": None,
    },
    AbortKind.OTHER: {
        "operator": RuleWords(Cause.OPERATOR, "the operator stopped it", "fly again when you are ready"),
        "record_lost": RuleWords(
            Cause.RECORD_LOST, "the record could not be written ({})", "make room on the disk"
        ),
        "internal_error": RuleWords(
            Cause.INTERNAL_ERROR,
            "an error of perchhw itself ({})",
            "keep the record and report it: events.jsonl has the traceback",
        ),
    },
}
"""Reasons by how they begin, tried in this order; ``{}`` in the words is what stands after the colon. None:
the reason, or what the record has of it, says more than a table could."""


def reason_in_words(aborted_by: str) -> RuleWords | None:
    """What a reason that is no rule with a limit means."""
    found = _beginning(aborted_by)
    if found is None or found[1] is None:
        return None
    words = found[1]
    return words._replace(words=words.words.format(aborted_by.partition(": ")[2]))


def _beginning(aborted_by: str) -> tuple[AbortKind, RuleWords | None] | None:
    for kind, reasons in _REASONS.items():
        for start, words in reasons.items():
            if aborted_by.startswith(start):
                return kind, words
    return None


def abort_kind(aborted_by: str, error: PerchhwError | None = None) -> AbortKind:
    """The kind of thing that ended a flight.

    Args:
        aborted_by: rule and what it found, as the record says it; of several the first.
        error: the error that ended it, if one did.
    """
    if isinstance(error, LinkError):
        return AbortKind.LINK
    if isinstance(error, MocapError):
        return AbortKind.MOCAP
    if (rule := KIND_OF_RULE.get(aborted_by.partition(":")[0])) is not None:
        return rule
    reason = _beginning(aborted_by)
    return AbortKind.OTHER if reason is None else reason[0]
