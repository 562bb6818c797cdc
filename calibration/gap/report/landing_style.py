"""How landings look on their page: a colour, a mark and a line for four legs, two and none."""

from calibration.gap.landings.outcomes.labels import FOUR, NONE, TWO

CLASS_WORDS = {FOUR: "four legs", TWO: "two legs", NONE: "none"}
CLASS_COLOURS = {FOUR: "#009e73", TWO: "#e69f00", NONE: "#d55e00"}
"""Okabe and Ito, "Color Universal Design", 2008: apart for every kind of colour vision."""
CLASS_MARKERS = {FOUR: "o", TWO: "s", NONE: "X"}
CLASS_LINES = {FOUR: "-", TWO: "--", NONE: ":"}
"""A shape and a line for each, so that nobody needs the colours."""


def short_name(name: str, most: int = 34) -> str:
    """A name of at most `most` letters."""
    return name if len(name) <= most else f"{name[: most - 1]}…"
