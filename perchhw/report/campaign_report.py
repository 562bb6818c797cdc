"""The report of a campaign, or of any folder of runs: outcomes by speed and angle, triggers, paths."""

import math
from collections import Counter
from contextlib import closing
from dataclasses import dataclass, replace
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from calibration.flights import UnusableFlightError
from calibration.flights.perchhw_run import load_run
from calibration.flights.run_folder import RunFolderError, is_run_folder, read_info
from perchhw.attempt import Outcome
from perchhw.campaign.store import CampaignError, CampaignStore, exists
from perchhw.record.listing import find_runs
from perchhw.report.campaign_plan import misfit_section
from perchhw.report.campaign_remarks import remarks_section
from perchhw.report.run_report import REPORT_FILE, write_run_report
from perchhw.report.style import (
    MUTED,
    OUTCOME_COLOURS,
    badge,
    grid,
    new_figure,
    page,
    report_style,
    section,
    svg,
    table,
)

_APPROACH_S, _LANDING_S = 1.2, 0.5


@dataclass(frozen=True)
class _Attempt:
    """One finished attempt as the report shows it."""

    speed: float
    angle_deg: float
    outcome: Outcome
    trigger: dict[str, Any] | None
    aborted_by: str | None
    record: Path | None


def write_campaign_report(folder: Path) -> Path:
    """Write ``report.html`` into `folder`, and one for each of its runs; damaged records are named in it.

    Args:
        folder: a campaign, or a folder of runs (as ``demo`` makes one).

    Raises:
        CampaignError: no campaign and no run in it.
    """
    if exists(folder):
        with closing(CampaignStore.open(folder)) as store:
            title, rows, skipped = f"Campaign {store.name}", store.rows(), store.skipped
        attempts = [
            _Attempt(r.speed, r.angle_deg, r.outcome, r.trigger, r.aborted_by, r.record)
            for r in rows
            if r.state == "done" and r.outcome is not None
        ]
        planned = len({r.slot for r in rows})
    else:
        title, attempts = f"Attempts in {folder.name}", _attempts_of_runs(folder)
        planned, skipped = len(attempts), []
    damaged: list[str] = []
    for index, attempt in enumerate(attempts):
        if attempt.record is not None and is_run_folder(attempt.record):
            try:
                write_run_report(attempt.record)
            except RunFolderError as error:
                damaged.append(str(error))
                attempts[index] = replace(attempt, record=None)
    path = folder / REPORT_FILE
    with report_style():
        body = _body(attempts, folder, damaged) + misfit_section(skipped)
    body += remarks_section(attempt.record for attempt in attempts if attempt.record is not None)
    path.write_text(page(title, _subtitle(attempts, planned), body), encoding="utf-8")
    return path


def _attempts_of_runs(folder: Path) -> list[_Attempt]:
    runs, _ = find_runs(folder) if folder.is_dir() else ([], [])
    attempts = []
    for run in runs:
        if run.speed is None or run.angle_deg is None or run.outcome not in tuple(Outcome):
            continue
        trigger = read_info(run.folder / "run.json").get("trigger")
        outcome = Outcome(run.outcome)
        attempts.append(_Attempt(run.speed, run.angle_deg, outcome, trigger, run.aborted_by, run.folder))
    if not attempts:
        raise CampaignError(f"{folder} holds neither a campaign nor a finished attempt")
    return attempts


def _subtitle(attempts: list[_Attempt], planned: int) -> str:
    done = len(attempts)
    if done == 0:
        return f"0 of {planned} attempts flown"
    successes = sum(a.outcome.success for a in attempts)
    low, high = wilson_interval(successes, done)
    return (
        f"{done} of {planned} attempts flown; success (four legs, no body contact) {successes} of {done}: "
        f"{successes / done:.0%} (95 % interval {low:.0%} to {high:.0%})"
    )


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """95 % interval of a rate (Wilson 1927): stays within 0 and 1 also for few trials."""
    z = 1.959964
    centre = (successes + z * z / 2) / (trials + z * z)
    half = z / (trials + z * z) * math.sqrt(successes * (trials - successes) / trials + z * z / 4)
    return max(0.0, centre - half), min(1.0, centre + half)


def _body(attempts: list[_Attempt], folder: Path, damaged: list[str]) -> str:
    if not attempts:
        return section("Attempts", "None was flown yet.")
    counts = Counter(a.outcome for a in attempts)
    rows = [
        [badge(outcome), str(counts[outcome]), f"{counts[outcome] / len(attempts):.0%}"]
        for outcome in Outcome
        if counts[outcome]
    ]
    panels = [
        section(
            "Outcomes", table(["outcome", "attempts", "share"], rows), "The colours mean the same below."
        ),
        section("By speed and angle", _outcome_map(attempts)),
    ]
    triggers = _trigger_map(attempts)
    if triggers is not None:
        panels.append(section("Where the policy fired", triggers))
    paths = _paths(attempts)
    if paths is not None:
        panels.append(
            section("Last approach to the ceiling", paths, "From 1.2 s before to 0.5 s after the trigger.")
        )
    unreadable = "".join(section("Damaged record", escape(reason)) for reason in damaged)
    return grid(panels) + section("Attempts", _attempt_table(attempts, folder)) + unreadable


def _outcome_map(attempts: list[_Attempt]) -> str:
    """Each attempt as a dot at its condition; repeats of a condition stand side by side."""
    figure = new_figure(5.2, 4.0)
    axes = figure.add_subplot()
    speeds = sorted({a.speed for a in attempts})
    angles = sorted({a.angle_deg for a in attempts})
    repeats = max(Counter((a.speed, a.angle_deg) for a in attempts).values())
    gap = min((b - a for a, b in pairwise(speeds)), default=0.5) / (repeats + 1)
    seen: Counter[tuple[float, float]] = Counter()
    for attempt in attempts:
        condition = (attempt.speed, attempt.angle_deg)
        offset = (seen[condition] - (repeats - 1) / 2) * gap
        seen[condition] += 1
        colour = OUTCOME_COLOURS[attempt.outcome]
        axes.plot(attempt.speed + offset, attempt.angle_deg, "o", ms=9, color=colour, mec="white")
    axes.set(xlabel="speed (m/s)", ylabel="approach angle (deg)", xticks=speeds, yticks=angles)
    axes.margins(0.15)
    return svg(figure)


def _trigger_map(attempts: list[_Attempt]) -> str | None:
    """Trigger states in optical-flow space, by outcome."""
    fired = [a for a in attempts if a.trigger and {"tau", "theta_x"} <= a.trigger.keys()]
    if not fired:
        return None
    figure = new_figure(5.2, 4.0)
    axes = figure.add_subplot()
    for a in fired:
        state = a.trigger or {}
        axes.plot(state["tau"], state["theta_x"], "o", ms=8, color=OUTCOME_COLOURS[a.outcome], mec="white")
    axes.set(xlabel=r"$\tau$ at the trigger (s)", ylabel=r"$\theta_x$ at the trigger (1/s)")
    axes.margins(0.15)
    return svg(figure)


def _paths(attempts: list[_Attempt]) -> str | None:
    """Side views of all attempts around the trigger, by outcome."""
    figure = new_figure(5.2, 4.0)
    axes = figure.add_subplot()
    drawn = False
    for attempt in attempts:
        if attempt.record is None or not is_run_folder(attempt.record):
            continue
        try:
            flight = load_run(attempt.record)
        except UnusableFlightError:
            continue
        if flight.trigger is None or not flight.has("x", "z"):
            continue
        t, position = flight.series("x", "z")
        after = t - flight.trigger.t
        near = (after > -_APPROACH_S) & (after < _LANDING_S)
        axes.plot(
            position[near, 0], position[near, 1], color=OUTCOME_COLOURS[attempt.outcome], lw=1.2, alpha=0.8
        )
        if flight.ceiling_z is not None:
            axes.axhline(flight.ceiling_z, color=MUTED, lw=2)
        drawn = True
    if not drawn:
        return None
    axes.set(xlabel="x (m)", ylabel="z (m)")
    axes.set_aspect("equal", adjustable="datalim")
    return svg(figure)


def _attempt_table(attempts: list[_Attempt], folder: Path) -> str:
    rows = []
    for number, attempt in enumerate(attempts):
        state = attempt.trigger or {}
        rows.append(
            [
                str(number),
                f"{attempt.speed:g}",
                f"{attempt.angle_deg:g}",
                badge(attempt.outcome),
                _number(state.get("tau"), "{:.3f}"),
                _number(state.get("theta_x"), "{:.2f}"),
                _number(state.get("d_ceil"), "{:.3f}"),
                _number(state.get("a_rot"), "{:.2f}", 1e3),
                escape(attempt.aborted_by or ""),
                _link(attempt.record, folder),
            ]
        )
    header = [
        "#",
        "m/s",
        "deg",
        "outcome",
        "tau (s)",
        "theta_x (1/s)",
        "d_ceil (m)",
        "a_rot (N mm)",
        "aborted by",
        "",
    ]
    return table(header, rows)


def _number(value: Any, form: str, scale: float = 1.0) -> str:
    return form.format(value * scale) if isinstance(value, int | float) and np.isfinite(value) else ""


def _link(record: Path | None, folder: Path) -> str:
    """A link to the run's own report, relative to the campaign's."""
    if record is None or not is_run_folder(record):
        return ""
    target = record.relative_to(folder) / REPORT_FILE
    return f'<a href="{escape(target.as_posix())}">report</a>'
