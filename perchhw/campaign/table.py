"""A campaign as tables in the terminal: what was flown and what is left."""

from collections import Counter
from collections.abc import Iterable

from rich.markup import escape
from rich.table import Column, Table

from perchhw.attempt import Outcome
from perchhw.campaign.seats import drone_names, seat_of
from perchhw.campaign.store import AttemptRow
from perchhw.record.listing import kept_sentence

_STYLES = {
    Outcome.FOUR_LEG: "green",
    Outcome.FOUR_LEG_BODY_CONTACT: "yellow",
    Outcome.TWO_LEG: "yellow",
    Outcome.TWO_LEG_BODY_CONTACT: "yellow",
    Outcome.FAILURE: "red",
    Outcome.NO_TRIGGER: "red",
    Outcome.ABORTED: "magenta",
}


def attempts_table(rows: list[AttemptRow], planned: int) -> Table:
    """One line per try of `planned` attempts; who flew it where several drones do."""
    title = progress(rows, planned)
    seats = [seat_of(row.record) for row in rows]
    names = drone_names(seat for seat in seats if seat is not None)
    columns: list[str | Column] = ["#", "m/s", "deg", "try", *(["drone"] if names else []), "state"]
    whole = max((len(row.outcome.value) for row in rows if row.outcome is not None), default=0)
    columns += [Column("outcome", overflow="fold", min_width=whole), "tau", "what happened"]
    table = Table(*columns, title=title, box=None, pad_edge=False, collapse_padding=True)
    for row, seat in zip(rows, seats, strict=True):
        outcome = "" if row.outcome is None else f"[{_STYLES[row.outcome]}]{row.outcome.value}[/]"
        tau = (row.trigger or {}).get("tau")
        table.add_row(
            str(row.slot),
            f"{row.speed:g}",
            f"{row.angle_deg:g}",
            str(row.try_number),
            *(["" if seat is None else escape(names[seat.drone])] if names else []),
            f"[bold]{row.state}[/]" if row.state == "running" else row.state,
            outcome,
            "" if tau is None else f"{tau:.3f}",
            escape(_why(row)),
        )
    return table


def _why(row: AttemptRow) -> str:
    """What kept an attempt from its landing; nothing of one that landed as it should."""
    if row.outcome is Outcome.FOUR_LEG:
        return ""
    return kept_sentence(row.record) or row.aborted_by or ""


def progress(rows: Iterable[AttemptRow], planned: int) -> str:
    """``7 of 20 done: four_leg 5, two_leg 2``."""
    counts = outcome_counts(rows)
    done = sum(counts.values())
    words = ", ".join(f"{outcome.value} {n}" for outcome, n in counts.items())
    return f"{done} of {planned} done" + (f": {words}" if words else "")


def outcome_counts(rows: Iterable[AttemptRow]) -> dict[Outcome, int]:
    """Number of done attempts by outcome, in the order of the outcomes; those that occur."""
    counts = Counter(row.outcome for row in rows if row.state == "done")
    return {outcome: counts[outcome] for outcome in Outcome if counts[outcome]}
