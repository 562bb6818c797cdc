"""``perchhw check``: the morning's question."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from perchhw.cli import exit_codes
from perchhw.cli.flight_page import draw_page
from perchhw.cli.lab_options import LabDrone, LabLegs, LabMocap, LabVehicle
from perchhw.cli.options import Lab
from perchhw.cli.output import emit

if TYPE_CHECKING:
    from perchhw.flight.course import CourseResult
    from perchhw.hover_check.check import HoverCheck
    from perchhw.hover_check.judge import CheckedQuantity

app = typer.Typer(add_completion=False, no_args_is_help=True, help="Is it the same drone as yesterday?")

_ON_ITS_MARK = "Put the drone upright on its start mark facing +x, with a full pack"


@app.callback()
def _group() -> None:
    """Keeps `hover` a verb of its own beside those that may come."""


@app.command()
def hover(
    lab: Lab = None,
    drone: LabDrone = None,
    mocap: LabMocap = None,
    vehicle: LabVehicle = None,
    legs: LabLegs = None,
    seconds: Annotated[float, typer.Option(min=5.0, max=120.0, help="Of hover.")] = 60.0,
    out: Annotated[Path, typer.Option(help="Folder for the records; earlier checks are there.")] = Path(
        "runs"
    ),
    begin_anew: Annotated[
        bool,
        typer.Option(
            "--begin-anew", help="What was changed was meant: the days are counted from this check."
        ),
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask whether the drone stands ready.")] = False,
) -> int:
    """Hover, tilt a little, land; then hold thrust, motors, lag, vibration and mocap against file and days.

    Exit codes: 0 the same drone, 1 something changed or is not as the vehicle file says, 2 input that cannot
    be used, 3 a safety rule refused or ended it, 130 interrupted.
    """
    from onboard.link.exclusive import hold
    from perchhw.cli.prompts import confirmation
    from perchhw.flight.turnaround import Turnaround
    from perchhw.hover_check.check import examine_check, fly_check
    from perchhw.hover_check.ended import examine_ended
    from perchhw.lab import find_lab, flight_setup
    from perchhw.screen.flight_display import flight_display

    setup = flight_setup(find_lab(lab), drone=drone, mocap=mocap, vehicle=vehicle, legs=legs)
    setup.check()
    with hold(setup.drone), flight_display("check hover", setup.drone) as display:
        Turnaround(setup.drone, confirmation(yes, display), _ON_ITS_MARK).put_back()
        flown = fly_check(setup, out, seconds, display)
    try:
        if flown.aborted_by is not None:
            _tell_aborted(flown, examine_ended(flown.record, setup, out))
            return exit_codes.SAFETY
        check = examine_check(flown.record, setup, out, begins_anew=begin_anew)
        emit(check, in_words(check))
    finally:
        draw_page(flown.record)  # last, for its drawing may be interrupted
    return exit_codes.DONE if check.same else exit_codes.FAILED


def _tell_aborted(flown: "CourseResult", lines: "tuple[CheckedQuantity, ...]") -> None:
    document = {
        "same": None,
        "aborted_by": flown.aborted_by,
        "lines": lines,
        "diagnosis": flown.diagnosis,
        "record": str(flown.record),
    }
    said = [*as_table(lines), f"not judged: the flight was ended by {flown.aborted_by}"]
    if flown.diagnosis is not None:
        said += [flown.diagnosis["sentence"], f"next: {flown.diagnosis['next']}"]
    said += [f"record: {flown.record}", "perchhw bringup --step hover says more; docs/safety.md has the rule"]
    emit(document, "\n".join(said))


def in_words(check: "HoverCheck") -> str:
    """A line a quantity, what to do about those that changed, and the answer."""
    lines = as_table(check.lines)
    if check.rotors:
        each = ", ".join(f"M{number} {rotor.rate_hz:.0f} Hz" for number, rotor in enumerate(check.rotors, 1))
        sigma = max(rotor.sigma_hz for rotor in check.rotors)
        lines.append(f"rotors  {each}, each +-{2.0 * sigma:.0f} Hz: {_folding(check)}")
    told = [check.verdict]
    if check.busy is not None:
        why = "" if check.busy in check.verdict else f"{check.busy}; "
        told.append(f"{why}this check is none of the days that later ones are held against")
    return "\n".join([*lines, "", *told, f"record: {check.record}"])


def _folding(check: "HoverCheck") -> str:
    levels = [(f"M{n}", one) for n, one in enumerate(check.rotors, 1) if one.told]
    if not levels:
        return "a log of 100 Hz folds their lines to anywhere, and none can be told from the others"
    return ", ".join(f"{name} at {one.folded_hz:.0f} Hz {one.gyro or 0.0:.2g} rad/s" for name, one in levels)


def as_table(lines: "Sequence[CheckedQuantity]") -> list[str]:
    """A row a quantity under a head, as wide as must be; what to do about it below its row."""
    if not lines:
        return []
    rows = [("", "what", "today", "vehicle file", "E_n", "days before"), *map(_cells, lines)]
    wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
    head, *shown = ("  ".join(map(str.ljust, row, wide)).rstrip() for row in rows)
    told = [head]
    for text, line in zip(shown, lines, strict=True):
        told.append(text)
        if line.settles is not None:
            below = " " * (wide[0] + 2)
            told += [f"{below}{line.held.meaning}", f"{below}-> {line.settles}"]
    return told


def _cells(line: "CheckedQuantity") -> tuple[str, ...]:
    factor, unit = line.held.shown
    today, days = in_digits(factor * line.measured.value, factor * line.measured.u95), ""
    if line.days is not None:
        mean, reach = factor * line.days.mean, factor * (line.days.high - line.days.mean)
        days = f"{in_digits(mean, reach)} of {line.days.checks}"
    expected, ratio = line.expected, "" if line.ratio is None else f"{line.ratio:.2f}"
    file = "" if expected is None else in_digits(factor * expected.value, factor * expected.u95)
    return line.verdict.value, line.held.what, f"{today} {unit}", file, ratio, days


def in_digits(value: float, u95: float) -> str:
    """A value to the second digit of its uncertainty; four digits of one that has none."""
    if u95 < 1e-9 or not math.isfinite(u95):
        return f"{0.0 if abs(value) < 1e-9 else value:.4g} ± {0 if u95 < 1e-9 else u95:g}"
    places = max(0, 1 - math.floor(math.log10(u95)))
    return f"{round(value, places) + 0.0:.{places}f} ± {u95:.{places}f}"
