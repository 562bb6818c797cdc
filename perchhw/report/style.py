"""How reports of flights look: the look of all reports, and the colours of the outcomes."""

from calibration.report_style import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    TRIGGER,
    grid,
    new_figure,
    page,
    report_style,
    section,
    svg,
    table,
)
from perchhw.attempt import Outcome

__all__ = [
    "BLUE",
    "GREEN",
    "INK",
    "MUTED",
    "ORANGE",
    "OUTCOME_COLOURS",
    "TRIGGER",
    "badge",
    "grid",
    "new_figure",
    "page",
    "report_style",
    "section",
    "svg",
    "table",
]

OUTCOME_COLOURS: dict[Outcome, str] = {
    Outcome.FOUR_LEG: "#1a7f4b",
    Outcome.FOUR_LEG_BODY_CONTACT: "#8ab34a",
    Outcome.TWO_LEG: "#d9a514",
    Outcome.TWO_LEG_BODY_CONTACT: "#d97b29",
    Outcome.FAILURE: "#c0392b",
    Outcome.NO_TRIGGER: "#7d4ea8",
    Outcome.ABORTED: "#7a7f87",
}


def badge(outcome: Outcome | None) -> str:
    """The outcome as a coloured label."""
    if outcome is None:
        return '<span class="badge" style="background:#aab1ba">none</span>'
    return f'<span class="badge" style="background:{OUTCOME_COLOURS[outcome]}">{outcome.value}</span>'
