"""How outcomes look in reports: colours, shapes, labels."""

from html import escape

from calibration.report_style import MUTED
from perchhw.attempt import Outcome

OUTCOME_COLOURS: dict[Outcome, str] = {
    Outcome.FOUR_LEG: "#1a7f4b",
    Outcome.FOUR_LEG_BODY_CONTACT: "#5f8a2a",
    Outcome.TWO_LEG: "#9c7408",
    Outcome.TWO_LEG_BODY_CONTACT: "#b85c12",
    Outcome.FAILURE: "#c0392b",
    Outcome.NO_TRIGGER: "#7d4ea8",
    Outcome.ABORTED: "#7a7f87",
}


OUTCOME_MARKERS: dict[Outcome, str] = {
    Outcome.FOUR_LEG: "o",
    Outcome.FOUR_LEG_BODY_CONTACT: "D",
    Outcome.TWO_LEG: "s",
    Outcome.TWO_LEG_BODY_CONTACT: "^",
    Outcome.FAILURE: "X",
    Outcome.NO_TRIGGER: "P",
    Outcome.ABORTED: "v",
}
"""A shape for each, so that nobody needs the colours."""
_SHAPES = {"o": "●", "D": "◆", "s": "■", "^": "▲", "X": "✖", "P": "✚", "v": "▼"}


def badge(outcome: Outcome | str | None) -> str:
    """The outcome as a coloured label with its shape; grey for what is no landing's, such as ``flown``."""
    if not isinstance(outcome, Outcome):
        words = "no outcome" if outcome is None else escape(outcome.replace("_", " "))
        return f'<span class="badge" style="background:{MUTED}">{words}</span>'
    shape = _SHAPES[OUTCOME_MARKERS[outcome]]
    colour = OUTCOME_COLOURS[outcome]
    return f'<span class="badge" style="background:{colour}">{shape} {outcome.value}</span>'
