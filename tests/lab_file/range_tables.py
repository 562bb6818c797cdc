"""The tables of ranges as docs/lab_file.md and docs/safety.md show them, made from the code."""

from collections.abc import Iterable

from onboard.bounds import Bounds, number_text
from onboard.lab_file import Ceiling, LabMocap, LabRoom, StartMark, SubjectToBody, bounds_of
from onboard.lab_file.bounds import OFFSET
from perchhw.supervisor import allowed_limits

SECTIONS = {"room": LabRoom, "room.ceiling": Ceiling, "start": StartMark, "mocap": LabMocap}


def limits_table() -> str:
    """Every limit with what it usually is, and what a lab file may make of it."""
    rows = [("limit", "unit in the file", "usual", "strictest", "loosest")]
    for name, (default, strictest, loosest, bounds) in allowed_limits().items():
        numbers = (number_text(value, bounds.unit, with_unit=True) for value in (default, strictest, loosest))
        rows.append((f"`{name}`", bounds.unit, *numbers))
    return table(rows)


def reasons_table() -> str:
    """Why the ranges end where they do."""
    rows = [("limit", "strictest", "because", "loosest", "because")]
    for name, limit in allowed_limits().items():
        unit = limit.bounds.unit
        ends = (limit.bounds.why_least, limit.bounds.why_most)
        tight, loose = ends if limit.strictest < limit.loosest else reversed(ends)
        loosest = number_text(limit.loosest, unit, with_unit=True)
        rows.append(
            (
                f"`{name}`",
                number_text(limit.strictest, unit, with_unit=True),
                tight,
                f"{loosest}, as usual" if limit.fixed else loosest,
                loose,
            )
        )
    return table(rows)


def places_table() -> str:
    """The ranges of everything else in a lab file."""
    rows = [("number", "allowed", "sigma at most", "because")]
    for section, kind in SECTIONS.items():
        rows += [_row(f"{section}.{name}", bounds) for name, bounds in bounds_of(kind).items()]
    assert not bounds_of(SubjectToBody), "its position is a list"
    rows.append(_row("mocap.subject_to_body.position", OFFSET))
    return table(rows)


def _row(name: str, bounds: Bounds) -> tuple[str, str, str, str]:
    sigma = "" if bounds.sigma == float("inf") else number_text(bounds.sigma, bounds.unit, with_unit=True)
    why = bounds.why_least + (f"; {bounds.why_most}" if bounds.why_most else "")
    return f"`{name}`", bounds.text, sigma, why


def table(rows: Iterable[tuple[str, ...]]) -> str:
    """Rows, the first of which is the heading, as Markdown."""
    heading, *body = rows
    return "\n".join(f"| {' | '.join(row)} |" for row in (heading, ("---",) * len(heading), *body))
