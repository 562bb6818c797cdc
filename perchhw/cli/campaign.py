"""``perchhw campaign``: fly a grid of attempts; resume, status, report."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from onboard.json_file import as_json
from perchhw.cli.campaign_plan import plan as plan_command
from perchhw.cli.options import AcceptMismatch, Drones, Lab, Mavlink, Note, Operator
from perchhw.cli.output import emit
from perchhw.cli.view_option import LiveView, ViewKind, live_view
from perchhw.consoles import console, progress_console, say

if TYPE_CHECKING:
    from perchhw.campaign.adaptive import FlownMap
    from perchhw.campaign.courses import FlightPlan

app = typer.Typer(add_completion=False)
app.command("plan")(plan_command)

_CampaignFolder = Annotated[Path, typer.Argument(help="Folder of a campaign.")]


@app.command()
def run(
    file: Annotated[Path, typer.Argument(help="Campaign file (TOML).")],
    resume: Annotated[bool, typer.Option("--resume", help="Continue where the campaign stopped.")] = False,
    retry_aborted: Annotated[
        bool, typer.Option("--retry-aborted", help="With --resume: fly aborted attempts again.")
    ] = False,
    skip_unflyable: Annotated[
        bool, typer.Option("--skip-unflyable", help="Leave out what does not fit the room; it is recorded.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Campaign folder; default: runs/campaign-NAME.")] = None,
    lab: Lab = None,
    drone: Drones = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before each attempt.")] = False,
    operator: Operator = None,
    note: Note = None,
    accept_mismatch: AcceptMismatch = False,
    mavlink: Mavlink = None,
    view: LiveView = None,
) -> int:
    """Fly the attempts of a campaign file, one after another, and write its report; or its test flights.

    What the file leaves out of drone, mocap, vehicle, legs, policy and room is as in the lab file.

    Exit codes: 0 all attempts are done, 2 the file or folder cannot be used, 3 the drone must be looked at
    (too many attempts or a test flight aborted, stopped by others, a stop not confirmed), 130
    interrupted (continue with --resume).
    """
    from dataclasses import replace

    from onboard.link.errors import DroneStopped
    from onboard.record.folder import slug
    from perchhw.campaign import CampaignStopped, check_approaches, flyable_part, load_plan
    from perchhw.campaign.courses import has_flights, load_flight_plan
    from perchhw.campaign.plan import Slot
    from perchhw.campaign.run import refuse_running, request_of
    from perchhw.campaign.seats import drone_names, hold_all
    from perchhw.cli.displayed_campaign import run_displayed
    from perchhw.flight.fit import check_fit
    from perchhw.flight.ground_station import ground_station
    from perchhw.lab import find_lab
    from perchhw.screen.flight_display import flight_display

    if retry_aborted and not resume:
        raise typer.BadParameter("--retry-aborted goes with --resume")
    if has_flights(file):
        _refuse_of_grids({"--skip-unflyable": skip_unflyable, "--accept-mismatch": accept_mismatch})
        flights = replace(load_flight_plan(file, find_lab(lab), drone or ()), operator=operator, note=note)
        return _fly_courses(flights, out, resume, yes, mavlink, view)
    plan = load_plan(file, find_lab(lab), drone or ())
    plan = replace(plan, operator=operator, note=note, accept_mismatch=accept_mismatch)
    check_fit(request_of(plan, Slot(0, plan.speeds[0], plan.angles_deg[0], 1), Path(), try_number=1))
    if skip_unflyable:
        plan = flyable_part(plan)
    else:
        check_approaches(plan)
    folder = out or Path("runs") / f"campaign-{slug(plan.name)}"
    names, stopped = drone_names(plan.drones), None
    refuse_running(folder)
    with _told_how_to_go_on(folder):
        try:
            with (
                hold_all(plan.drones),
                ground_station(mavlink) as listener,
                flight_display(f"campaign {plan.name}", ", ".join(names.values()) or plan.drone) as display,
                live_view(view, folder, display),
            ):
                run_displayed(
                    plan, folder, display, yes, listener, resume=resume, retry_aborted=retry_aborted
                )
        except (CampaignStopped, DroneStopped) as stop:
            stopped = str(stop)
            progress_console().print(stopped, style="red", markup=False)
        report = _page_of(folder)
    _emit_rows(folder, report, stopped)
    return 3 if stopped else 0


def _refuse_of_grids(given: Mapping[str, bool]) -> None:
    """Test flights fly no policy, and each of them must fit the room."""
    for option in [option for option, wanted in given.items() if wanted]:
        raise typer.BadParameter(f"{option} is for campaigns with a [grid]; leave it out for test flights")


@contextmanager
def _told_how_to_go_on(folder: Path) -> Iterator[None]:
    """Whoever interrupts the campaign in `folder` is told how its last flight ended, and how to continue."""
    from perchhw.campaign.run import ATTEMPTS
    from perchhw.record.listing import kept_diagnosis

    before = set((folder / ATTEMPTS).glob("*"))
    try:
        yield
    except KeyboardInterrupt:
        last = max(
            set((folder / ATTEMPTS).glob("*")) - before, default=None
        )  # their names begin with the time
        if (told := kept_diagnosis(last)) is not None:
            say(progress_console(), f"{told['sentence']}\nnext: {told['next']}")
        say(progress_console(), f"continue with --resume; the records are in {folder}")
        raise


def _fly_courses(
    plan: "FlightPlan",
    out: Path | None,
    resume: bool,
    yes: bool,
    mavlink: str | None,
    view: ViewKind | None,
) -> int:
    """Fly a campaign of test flights."""
    from onboard.link.exclusive import hold
    from onboard.record.folder import slug
    from perchhw.campaign.run import refuse_running
    from perchhw.cli.displayed_campaign import fly_courses_displayed
    from perchhw.flight.ground_station import ground_station
    from perchhw.screen.flight_display import flight_display

    folder = out or Path("runs") / f"campaign-{slug(plan.name)}"
    refuse_running(folder)
    with _told_how_to_go_on(folder):
        with (
            hold(plan.setup.drone),
            ground_station(mavlink) as listener,
            flight_display(f"campaign {plan.name}", plan.setup.drone) as display,
            live_view(view, folder, display),
        ):
            rows = fly_courses_displayed(plan, folder, display, yes, listener, resume=resume)
        _report_courses(folder)
    stopped = next((row.aborted_by for row in rows if row.aborted_by), None)
    _emit_courses(folder, stopped)
    return 3 if stopped else 0


def _page_of(folder: Path) -> Path | None:
    """Write the report of a campaign that was just flown; a full disk costs it and no result."""
    from onboard.record.folder import OutputFolderError
    from perchhw.report.campaign_report import write_campaign_report

    try:
        return write_campaign_report(folder, draw_all=False)
    except OutputFolderError as error:
        say(progress_console(), f"no report: {error}", "red")
        return None


def _report_courses(folder: Path) -> None:
    """Write the page of each test flight of a campaign."""
    from contextlib import closing

    from perchhw.campaign.courses import FlightStore
    from perchhw.report.run_report import report_flight

    with closing(FlightStore.open(folder)) as store:
        records = [row.record for row in store.rows() if row.record is not None]
    for record in records:
        report_flight(record)


def _emit_courses(folder: Path, stopped: str | None = None) -> None:
    """Where each test flight of a campaign stands."""
    from contextlib import closing

    from perchhw.campaign.courses import FlightStore
    from perchhw.record.listing import kept_diagnosis

    with closing(FlightStore.open(folder)) as store:
        rows = store.last_tries()
    flights: list[dict[str, Any]] = [
        {
            "kind": row.kind,
            "done": row.done,
            "record": row.record,
            "aborted_by": row.aborted_by,
            "diagnosis": kept_diagnosis(row.record),
        }
        for row in rows
    ]
    document: dict[str, Any] = {
        "campaign": folder,
        "planned": len(rows),
        "done": sum(row.done for row in rows),
        "flights": flights,
        "stopped": stopped,
    }
    emit(document, "\n".join(map(_course_in_words, flights)))


def _course_in_words(flight: dict[str, Any]) -> str:
    said = f"{flight['kind']}: {flight['aborted_by'] or ('flown' if flight['done'] else 'left')}"
    said += "" if flight["record"] is None else f"  {flight['record']}"
    told = flight["diagnosis"]
    return said if told is None else f"{said}\n  {told['sentence']}\n  next: {told['next']}"


@app.command()
def status(folder: _CampaignFolder) -> int:
    """What of a campaign was flown, how it ended, and what is left."""
    from perchhw.campaign.courses import FlightStore

    if FlightStore.exists(folder):
        _emit_courses(folder)
    else:
        _emit_rows(folder, None)
    return 0


@app.command()
def report(folder: _CampaignFolder) -> int:
    """Write the report of a campaign, or the pages of its test flights."""
    from perchhw.campaign.courses import FlightStore
    from perchhw.report.campaign_report import write_campaign_report

    if FlightStore.exists(folder):
        _report_courses(folder)
        _emit_courses(folder)
        return 0
    _emit_rows(folder, write_campaign_report(folder))
    return 0


_LEFT_ALONE = "no process runs this campaign: the one that did ended in an attempt; go on with --resume"


def _emit_rows(folder: Path, report: Path | None, stopped: str | None = None) -> None:
    from contextlib import closing

    from perchhw.campaign import CampaignStore
    from perchhw.campaign.adaptive import flown_map
    from perchhw.campaign.run import is_held
    from perchhw.campaign.seats import seat_of
    from perchhw.campaign.table import attempts_table, outcome_counts

    with closing(CampaignStore.open(folder)) as store:
        rows, skipped, planned = store.rows(), store.skipped, store.planned
        found = flown_map(rows, store.conditions) if store.conditions else None
    counts = outcome_counts(rows)
    left_alone = any(row.state == "running" for row in rows) and not is_held(folder)
    document: dict[str, Any] = {
        "campaign": folder,
        "planned": planned,
        "done": sum(counts.values()),
        "outcomes": counts,
        "map": None if found is None else _map_document(found),
        "attempts": [
            as_json(row) | {"drone": None if (seat := seat_of(row.record)) is None else seat.drone}
            for row in rows
        ],
        "skipped": skipped,
        "left_alone": left_alone,
        "report": report,
        "stopped": stopped,
    }

    def draw() -> None:
        console().print(attempts_table(rows, planned))
        for misfit in skipped:
            left_out = f"left out: {misfit.speed:g} m/s at {misfit.angle_deg:g} deg {misfit.remedy}"
            say(console(), left_out)
        if left_alone:
            say(console(), _LEFT_ALONE)
        if report is not None:
            console().print(f"report: {report}", markup=False)

    emit(document, draw)


def _map_document(found: "FlownMap") -> dict[str, Any]:
    """Landing rates by condition, with what is expected between and around what was flown."""
    known = found.known
    columns = zip(found.conditions, found.flown, found.landed, known.rate, known.deviation, strict=True)
    return {
        "expected_error": known.error,
        "conditions": [
            {
                "speed": speed,
                "angle_deg": angle,
                "flown": flown,
                "landed": landed,
                "rate": float(rate),
                "deviation": float(deviation),
            }
            for (speed, angle), flown, landed, rate, deviation in columns
        ],
    }
