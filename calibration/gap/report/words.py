"""The verdict in words, and numbers as the page shows them."""

from calibration.gap.data.found_effect import FoundEffect, FoundParameter, Verdict
from calibration.gap.report.document import GapReport, Levels
from calibration.gap.search.naming import FEWEST, REAL
from calibration.measurement import Interval


def number(value: float | int | None) -> str:
    """A number with four digits; an integer in full; nothing for a missing one."""
    if value is None:
        return ""
    return str(value) if isinstance(value, int) else f"{value:.4g}"


def interval(ci95: Interval) -> str:
    """Both ends of an interval."""
    return f"{number(ci95[0])} to {number(ci95[1])}"


def unit(text: str) -> str:
    """A unit to stand behind a number; none for pure numbers."""
    return "" if text in ("", "1") else f" {text}"


def plain(name: str) -> str:
    """The name of an effect, channel or phase as words."""
    return name.replace("_", " ")


def capital(text: str) -> str:
    """The text as it begins a sentence."""
    return text[:1].upper() + text[1:]


def listed(names: list[str]) -> str:
    """a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def parameter(name: str, found: FoundParameter) -> str:
    """``scale 0.951 (95 %: 0.948 to 0.954)``."""
    warning = ""
    if found.unseen:
        warning = ", all that is physical: these flights do not tell"
    elif found.at_bound:
        warning = ", at the limit of what is physical"
    return f"{plain(name)} {number(found.value)}{unit(found.unit)} (95 %: {interval(found.ci95)}{warning})"


def headline(report: GapReport) -> str:
    """The verdict in one sentence."""
    names = [plain(effect.name) for effect in report.effects]
    missing = f"{listed(names)} {'was' if len(names) == 1 else 'were'} missing" if names else ""
    if report.verdict is Verdict.NO_GAP and any(one.reason.startswith(REAL) for one in report.rejected):
        return (
            "Nothing is missing that matters; what is real and too small for a name is in the vehicle file."
        )
    if report.verdict is Verdict.NO_GAP:
        return (
            "Nothing is missing that these flights show: what is left of the error is what sensors, gusts "
            "and each flight's own thrust leave."
        )
    if report.verdict is Verdict.EFFECTS_FOUND:
        return f"Found: {missing} in the model."
    if names:
        return f"{capital(missing)}, and something else that is not known is still missing."
    if len(report.train) < FEWEST:
        return f"Something is missing, and fewer than {FEWEST} flights cannot name it: fly more."
    return "Something is missing that no known effect explains."


def gap_in_words(metric: str, levels: Levels, unseen: bool) -> str:
    """How far the gap went down, on flights that no fit saw (`unseen`) or on those that were fitted."""
    where = "on flights that no fit saw" if unseen else "on flights that were fitted, as none was kept back"
    text = f"{capital(metric)}, {where}: {number(levels.before)}{unit(levels.unit)} before"
    if levels.after != levels.before:
        text += f", {number(levels.after)}{unit(levels.unit)} after"
    if levels.noise_floor is not None:
        text += f"; gyro and accelerometer in place of a model give {number(levels.noise_floor)}"
        text += unit(levels.unit)
    text += "."
    if levels.closed_share is not None and levels.after != levels.before:
        text += f" Of what could be removed, {closed(levels.closed_share)} is gone."
    return text


def unnamed_in_words(levels: Levels) -> str:
    """What terms without a name do, which are in the vehicle file."""
    return (
        f"With names alone {number(levels.before)}{unit(levels.unit)} would be left; what has no name and is "
        f"in the vehicle file all the same brings it to {number(levels.after)}{unit(levels.unit)}."
    )


def closed(share: float) -> str:
    """Share of the removable gap that was closed; noise may put a model below its floor."""
    return "all" if share >= 1.0 else f"{100.0 * share:.0f} %"


_TOLD = ": "
"""Stands in what is said of a place or an error, and not in the name of what goes with it."""


def unexplained_in_words(report: GapReport) -> str:
    """Where the rest lives and what it looks like."""
    rest = report.unexplained
    text = f"{100.0 * rest.share:.0f} % of the gap is left and structured"
    if rest.channels:
        text += f", in {listed([plain(channel) for channel in rest.channels])}"
    sentences = [suspect for suspect in rest.suspects if _TOLD in suspect]
    if goes_with := [plain(suspect) for suspect in rest.suspects if suspect not in sentences]:
        text += f"; it goes with {listed(goes_with)}"
    return ". ".join([text, *(capital(plain(sentence)) for sentence in sentences)]) + "."


def ambiguity_in_words(effect: FoundEffect) -> str:
    """What the effect could be instead."""
    others = listed([plain(name) for name in effect.ambiguous_with])
    text = f"With these flights {plain(effect.name)} cannot be told from {others}."
    return f"{text} To tell: {effect.separated_by}." if effect.separated_by else text
