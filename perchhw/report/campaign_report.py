"""The report of a campaign, or of any folder of runs: outcomes by speed and angle, triggers, paths."""

from collections import Counter
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from calibration.flights import Flight, UnusableFlightError
from calibration.flights.perchhw_run import flight_from_run
from calibration.measurement import wilson_interval
from calibration.report_style import MUTED, grid, new_figure, page, report_style, section, svg, table
from onboard.atomic_file import write_atomically
from onboard.csv_file import read_csv
from onboard.record.folder import OutputFolderError
from onboard.record.run_record import RunFolderError, RunRecord, is_run_folder, read_info
from perchhw.attempt import Outcome
from perchhw.campaign.adaptive import FlownMap, flown_map
from perchhw.campaign.database import CampaignError
from perchhw.campaign.seats import drone_names, seat_of
from perchhw.campaign.store import CampaignStore
from perchhw.diagnosis.diagnose import diagnose_run, judge_of
from perchhw.record.listing import find_runs
from perchhw.record.run import read_run
from perchhw.report.campaign_figures import (
    ShownAttempt,
    batteries,
    landing_rates,
    order_of_events,
    trigger_states,
)
from perchhw.report.campaign_plan import misfit_section
from perchhw.report.campaign_remarks import remarks_section
from perchhw.report.map_figure import map_figure
from perchhw.report.outcome_style import OUTCOME_COLOURS, OUTCOME_MARKERS, badge
from perchhw.report.run_report import REPORT_FILE, has_current_page, write_run_page

PREDICTION_FILE = "prediction.csv"
"""Rates that the simulation predicts, beside the attempts; columns as in ``validation.csv``."""
_MAP_NOTE = (
    "What the attempts say of every condition of the grid, also of those between them (Gaussian process); "
    "discs were flown, with landings of attempts, squares were not."
)
_APPROACH_S, _LANDING_S = 1.2, 0.5
_NO_TIME = datetime.max.replace(tzinfo=UTC)


def write_campaign_report(folder: Path, *, draw_all: bool = True) -> Path:
    """Write ``report.html`` into `folder`, and one for each of its runs; damaged records are named in it.

    Args:
        folder: a campaign, or a folder of runs (as ``demo`` makes one).
        draw_all: draw the pages anew also of runs in which nothing was written since theirs.

    Raises:
        CampaignError: no campaign and no run in it.
        OutputFolderError: a page cannot be written.
    """
    if CampaignStore.exists(folder):
        with closing(CampaignStore.open(folder)) as store:
            title, rows, skipped = f"Campaign {store.name}", store.rows(), store.skipped
            planned = store.planned
            found = flown_map(rows, store.conditions) if store.conditions else None
        done = [r for r in rows if r.state == "done" and r.outcome is not None]
        attempts = [
            ShownAttempt(r.speed, r.angle_deg, r.outcome, r.trigger, r.aborted_by, r.record)
            for r in done
            if r.outcome is not None
        ]
    else:
        title, attempts = f"Attempts in {folder.name}", _attempts_of_runs(folder)
        planned, skipped, found = len(attempts), [], None
    damaged: list[str] = []
    looked_at = [_look(attempt, damaged, draw_all) for attempt in attempts]
    path = folder / REPORT_FILE
    with report_style():
        body = _body(_in_order(looked_at), folder, damaged, found) + misfit_section(skipped)
    body += remarks_section(one.run.folder for one in looked_at if one.run is not None)
    try:
        write_atomically(path, page(title, _subtitle(attempts, planned), body))
    except OSError as error:
        raise OutputFolderError(folder, error.strerror) from error
    return path


def _look(attempt: ShownAttempt, damaged: list[str], draw_all: bool) -> "_Seen":
    """Write the report of an attempt's run and take from its record what the campaign's page shows."""
    if attempt.record is None or not is_run_folder(attempt.record):
        return _Seen(attempt, None, None)
    try:
        run = read_run(attempt.record)
        drawn = not draw_all and has_current_page(attempt.record)
        found = diagnose_run(run) if drawn else write_run_page(run)
    except RunFolderError as error:
        damaged.append(str(error))
        return _Seen(replace(attempt, record=None), None, None)
    power = run.series.get("power")
    volts = np.empty(0) if power is None else power.numbers("vbat")
    volts = volts[np.isfinite(volts)]
    battery = (float(volts[:20].max()), float(volts.min())) if volts.size else None
    started = run.info.get("started_utc")
    return _Seen(
        replace(attempt, said=found.sentence, battery=battery),
        run,
        datetime.fromisoformat(started) if isinstance(started, str) else None,
    )


class _Seen(NamedTuple):
    """An attempt, its record and when it began; None where there is none that can be read."""

    attempt: ShownAttempt
    run: RunRecord | None
    started: datetime | None


def _in_order(seen: list[_Seen]) -> list[_Seen]:
    """The attempts as they were flown, with the minutes since the first began."""
    begun = [one.started for one in seen if one.started is not None]
    if not begun:
        return seen
    first = min(begun)
    timed = [
        one._replace(
            attempt=replace(
                one.attempt,
                minutes=None if one.started is None else (one.started - first).total_seconds() / 60.0,
            )
        )
        for one in seen
    ]
    return sorted(timed, key=lambda one: one.started or _NO_TIME)


def _attempts_of_runs(folder: Path) -> list[ShownAttempt]:
    runs, _ = find_runs(folder) if folder.is_dir() else ([], [])
    attempts = []
    for run in runs:
        if run.speed is None or run.angle_deg is None or run.outcome not in tuple(Outcome):
            continue
        trigger = read_info(run.folder).get("trigger")
        outcome = Outcome(run.outcome)
        attempts.append(ShownAttempt(run.speed, run.angle_deg, outcome, trigger, run.aborted_by, run.folder))
    if not attempts:
        raise CampaignError(f"{folder} holds neither a campaign nor a finished attempt")
    return attempts


def _subtitle(attempts: list[ShownAttempt], planned: int) -> str:
    done = len(attempts)
    early = sum(a.outcome is Outcome.ABORTED for a in attempts)
    flown = f"{done} of {planned} attempts flown" + (f", {early} of them ended early" if early else "")
    if done == early:
        return flown
    successes, ended = sum(a.outcome.success for a in attempts), done - early
    low, high = wilson_interval(successes, ended)
    return (
        f"{flown}; success (four legs, no body contact) {successes} of {ended}: "
        f"{successes / ended:.0%} (95 % interval {low:.0%} to {high:.0%})"
    )


def _body(seen: list[_Seen], folder: Path, damaged: list[str], found: FlownMap | None) -> str:
    if not seen:
        return section("Attempts", "None was flown yet.")
    attempts = [one.attempt for one in seen]
    flights = [one.run for one in seen if one.run is not None]
    policy = next((judge.flown for run in flights if (judge := judge_of(run)).flown is not None), None)
    predicted = predicted_rates(folder / PREDICTION_FILE, damaged)
    note = (
        "Four legs without body contact, with its 95 % interval (Wilson), of the attempts that nothing and "
        "nobody ended early."
    )
    body = section("Landing rates", landing_rates(attempts, predicted), note)
    if found is not None and any(found.flown):
        body += section("Map of the landing rate", map_figure(found), _MAP_NOTE)
    panels = [section("Outcomes", _counts(attempts), "Colours and shapes mean the same in all figures.")]
    for title, drawing, below in (
        ("Where the policy fired", trigger_states(attempts, policy), ""),
        ("Batteries", batteries(attempts), ""),
        ("Last approach to the ceiling", _paths(seen), "From 1.2 s before to 0.5 s after the trigger."),
    ):
        if drawing is not None:
            panels.append(section(title, drawing, below))
    order = order_of_events(attempts)
    body += grid(panels) + section("One after another", (order or "") + _aborts(attempts))
    unreadable = "".join(section("Cannot be read", escape(reason)) for reason in damaged)
    return body + section("Attempts", _attempt_table(attempts, folder)) + unreadable


def _counts(attempts: list[ShownAttempt]) -> str:
    counts = Counter(a.outcome for a in attempts)
    rows = [
        [badge(outcome), str(counts[outcome]), f"{counts[outcome] / len(attempts):.0%}"]
        for outcome in Outcome
        if counts[outcome]
    ]
    return table(["outcome", "attempts", "share"], rows)


def _aborts(attempts: list[ShownAttempt]) -> str:
    """The attempts that a rule, a person or a failure ended, in words."""
    rows = [
        [
            str(number),
            "" if a.minutes is None else f'<span class="n">{a.minutes:.1f} min</span>',
            escape(a.said or a.aborted_by or "ended for an unknown reason"),
        ]
        for number, a in enumerate(attempts)
        if a.outcome is Outcome.ABORTED
    ]
    return table(["attempt", "after", "what ended it"], rows) if rows else "<p>None was ended early.</p>"


def predicted_rates(path: Path, damaged: list[str]) -> dict[tuple[float, float], float]:
    """Predicted landing rates by speed and angle, if there are any; what is wrong goes to `damaged`."""
    if not path.is_file():
        return {}
    try:
        file = read_csv(path, CampaignError)
        columns = [file.finite(name) for name in ("speed_m_s", "angle_deg", "landing_rate")]
    except CampaignError as error:
        damaged.append(str(error))
        return {}
    return {(float(speed), float(angle)): float(rate) for speed, angle, rate in zip(*columns, strict=True)}


def _paths(seen: list[_Seen]) -> str | None:
    """Side views of all attempts around the trigger, by outcome."""
    figure = new_figure(5.2, 4.2)
    axes = figure.add_subplot()
    drawn = 0
    for one in seen:
        flight = _flight(one.run)
        if flight is None or flight.trigger is None or not flight.has("x", "z"):
            continue
        t, position = flight.series("x", "z")
        after = t - flight.trigger.t
        near = (after > -_APPROACH_S) & (after < _LANDING_S)
        outcome = one.attempt.outcome
        axes.plot(
            position[near, 0], position[near, 1], color=OUTCOME_COLOURS[outcome], lw=1.2, alpha=0.8,
            marker=OUTCOME_MARKERS[outcome], ms=5, markevery=[-1],
        )  # fmt: skip
        if flight.ceiling_z is not None:
            axes.axhline(flight.ceiling_z, color=MUTED, lw=2)
        drawn += 1
    if not drawn:
        return None
    axes.set(xlabel="x (m)", ylabel="z (m)")
    axes.set_aspect("equal", adjustable="datalim")
    return svg(figure, f"Paths of {drawn} attempts around the trigger, by outcome")


def _flight(run: RunRecord | None) -> Flight | None:
    if run is None:
        return None
    try:
        return flight_from_run(run)
    except UnusableFlightError:
        return None


def _attempt_table(attempts: list[ShownAttempt], folder: Path) -> str:
    seats = [seat_of(attempt.record) for attempt in attempts]
    names = drone_names(seat for seat in seats if seat is not None)
    rows = []
    for number, (attempt, seat) in enumerate(zip(attempts, seats, strict=True)):
        state = attempt.trigger or {}
        rows.append(
            [
                str(number),
                f"{attempt.speed:g}",
                f"{attempt.angle_deg:g}",
                *(["" if seat is None else escape(names[seat.drone])] if names else []),
                badge(attempt.outcome),
                _number(state.get("tau"), "{:.3f}"),
                _number(state.get("theta_x"), "{:.2f}"),
                escape(attempt.said or attempt.aborted_by or ""),
                _link(attempt.record, folder),
            ]
        )
    header = ["#", "m/s", "deg", *(["drone"] if names else []), "outcome", "tau (s)", "theta_x (1/s)"]
    return table([*header, "what happened", ""], rows)


def _number(value: Any, form: str, scale: float = 1.0) -> str:
    return form.format(value * scale) if isinstance(value, int | float) and np.isfinite(value) else ""


def _link(record: Path | None, folder: Path) -> str:
    """A link to the run's own report, relative to the campaign's."""
    if record is None or not is_run_folder(record):
        return ""
    target = record.relative_to(folder) / REPORT_FILE
    return f'<a href="{escape(target.as_posix())}">report</a>'
