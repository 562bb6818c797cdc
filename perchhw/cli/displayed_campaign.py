"""Flights one after another on a display: who begins, how they ended so far, notes and pauses in between."""

import itertools
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from perchhw.attempt import AttemptRequest, AttemptResult
from perchhw.cli.prompts import confirmation
from perchhw.flight.course import CourseRequest, CourseResult, fly_course
from perchhw.flight.ground_station import Listeners
from perchhw.screen.display import Display, Progress

if TYPE_CHECKING:
    from perchhw.campaign import AttemptRow, CampaignPlan
    from perchhw.campaign.courses import FlightPlan, FlightRow
    from perchhw.campaign.forecast import Forecast
    from perchhw.flight.recording import RecordListener


def run_displayed(
    plan: "CampaignPlan",
    folder: Path,
    display: Display,
    yes: bool,
    listener: "RecordListener | None" = None,
    **options: Any,
) -> "list[AttemptRow]":
    """As :func:`perchhw.campaign.run_campaign` with its `options`; all rows."""
    from perchhw.campaign import fit_grid, run_campaign
    from perchhw.campaign.forecast import forecast
    from perchhw.campaign.seats import drone_names
    from perchhw.flight.turnaround import attempt_after_attempt

    names = drone_names(plan.drones)

    def begin(request: AttemptRequest) -> None:
        again = f", try {request.try_number}" if request.try_number > 1 else ""
        whose = f", {names[request.drone]}" if names else ""
        condition = f"{request.speed:g} m/s, {request.angle_deg:g} deg{again}{whose}"
        display.begin(request.folder, condition, request.index + 1)

    runner = attempt_after_attempt(
        confirmation(yes, display),
        display.phase,
        listener=Listeners(listener, display),
        on_look=display.look,
        begin=begin,
        names=names,
    )

    def run(request: AttemptRequest) -> AttemptResult:
        display.between()
        return runner(request)

    cost = forecast(plan, fit_grid(plan).approaches)

    def show(rows: "list[AttemptRow]") -> None:
        display.progress(progress_of(rows, cost))

    return run_campaign(plan, folder, run, on_change=show, **options)


def progress_of(rows: "list[AttemptRow]", cost: "Forecast") -> Progress:
    """Counts so far; the time that the rest takes when it goes on as fast, operator and all, and before that
    is known as planned; packs that are still to be put in.
    """
    from perchhw.campaign.table import outcome_counts

    counts = outcome_counts(rows)
    left = cost.attempts - sum(counts.values())
    done = [row for row in rows if row.state == "done" and row.started_utc and row.ended_utc]
    left_s = cost.duration * left / max(1, cost.attempts)
    if len(done) > 1:
        began = min(datetime.fromisoformat(str(row.started_utc)) for row in done)
        ended = max(datetime.fromisoformat(str(row.ended_utc)) for row in done)
        left_s = (ended - began).total_seconds() / len(done) * left
    return Progress(
        attempts=cost.attempts,
        outcomes=tuple((outcome.value, count) for outcome, count in counts.items()),
        time_left_s=left_s,
        packs_left=sum(attempt >= sum(counts.values()) for attempt in cost.new_pack_before),
    )


def fly_courses_displayed(
    plan: "FlightPlan",
    folder: Path,
    display: Display,
    yes: bool,
    listener: "RecordListener | None",
    resume: bool,
) -> "list[FlightRow]":
    """As :func:`perchhw.campaign.courses.fly_plan`; all rows."""
    from perchhw.campaign.courses import fly_plan

    fly_displayed = partial(
        fly_course,
        on_phase=display.phase,
        on_look=display.look,
        listener=Listeners(listener, display),
    )
    count = len(plan.flights)
    number = itertools.count(1)

    def fly(request: CourseRequest) -> CourseResult:
        display.between()
        display.begin(request.folder, request.kind, next(number))
        return fly_displayed(request)

    def show(rows: "list[FlightRow]") -> None:
        done = sum(row.done for row in rows)
        display.progress(Progress(attempts=count, outcomes=(("flown", done),) if done else ()))

    display.progress(Progress(attempts=count))
    return fly_plan(plan, folder, confirmation(yes, display), resume=resume, on_change=show, fly=fly)
