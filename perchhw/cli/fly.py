"""``perchhw fly``: one supervised landing attempt."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from perchhw.attempt import (
    AttemptInterrupted,
    AttemptResult,
)
from perchhw.cli import exit_codes
from perchhw.cli.flight_page import draw_page
from perchhw.cli.lab_options import LabDrone, LabLegs, LabMocap, LabPolicy, LabVehicle
from perchhw.cli.options import AcceptMismatch, Lab, Mavlink, Note, Operator
from perchhw.cli.output import emit
from perchhw.cli.view_option import LiveView, live_view

app = typer.Typer(add_completion=False)

_DEFAULT = "Default: that of the lab file"


@app.command()
def fly(
    speed: Annotated[float, typer.Option(help="Speed on the approach line, m/s.")],
    angle: Annotated[float, typer.Option(help="Angle of the approach line above the horizon, deg.")],
    lab: Lab = None,
    drone: LabDrone = None,
    mocap: LabMocap = None,
    policy: LabPolicy = None,
    vehicle: LabVehicle = None,
    legs: LabLegs = None,
    ceiling: Annotated[
        float | None,
        typer.Option(help=f"Height of the ceiling over x = y = 0, m. {_DEFAULT}, or of the simulated room."),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the record (a new folder inside it).")] = Path("runs"),
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Check and upload; never arm.")] = False,
    put_back: Annotated[
        bool, typer.Option("--put-back", help="First put the drone back on its start mark and reboot it.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask whether it stands there.")] = False,
    operator: Operator = None,
    note: Note = None,
    accept_mismatch: AcceptMismatch = False,
    mavlink: Mavlink = None,
    view: LiveView = None,
) -> int:
    """Fly one attempt: check, upload and verify, arm, take off, approach, land upside down, label.

    What no option says is as in the lab file; on hardware nothing flies without one.

    A drone that has flown or was stopped is locked: on a terminal it is asked for back on its mark, and
    rebooted; --yes answers that. Without a terminal --put-back does it, or the attempt ends before take-off.

    Exit codes: 0 landed (or the dry run passed), 1 not landed, 2 input that cannot be used, 3 a safety rule
    refused or ended it, 130 interrupted: landed by the first Ctrl-C, motors cut by the second.
    """
    from dataclasses import replace

    from onboard.link.exclusive import hold
    from perchhw.cli.prompts import confirmation
    from perchhw.flight import check_attempt, fly_attempt
    from perchhw.flight.ground_station import Listeners, ground_station
    from perchhw.flight.turnaround import Turnaround
    from perchhw.lab import find_lab, flight_setup
    from perchhw.record import discard_if_empty
    from perchhw.screen.flight_display import flight_display

    setup = flight_setup(
        find_lab(lab), drone=drone, mocap=mocap, vehicle=vehicle, legs=legs, policy=policy, ceiling=ceiling
    )
    setup.check()
    request = replace(
        setup.attempt(speed, angle, out), operator=operator, note=note, accept_mismatch=accept_mismatch
    )
    result: AttemptResult | None = None
    try:
        checked = check_attempt(request, dry_run)  # before anybody who flies the drone is asked to make room
        with (
            hold(setup.drone),
            ground_station(mavlink) as listener,
            flight_display("fly", setup.drone) as display,
            live_view(view, request.folder, display),
        ):
            if put_back:
                Turnaround(setup.drone, confirmation(yes, display)).put_back()
            elif yes or sys.stdin.isatty():
                Turnaround(setup.drone, confirmation(yes, display)).put_back_if_needed()
            display.begin(request.folder, f"{speed:g} m/s, {angle:g} deg")
            result = fly_attempt(
                request,
                dry_run=dry_run,
                checked=checked,
                on_phase=display.phase,
                on_look=display.look,
                listener=Listeners(listener, display),
            )
    except AttemptInterrupted as interrupted:
        result = interrupted.result
        raise
    finally:
        if result is not None:  # before the page, whose drawing somebody may interrupt
            _emit(result, dry_run)
        draw_page(request.folder)
        discard_if_empty(request.folder)
    if result.aborted_by is not None:
        return exit_codes.SAFETY
    return exit_codes.DONE if dry_run or result.outcome.attached else exit_codes.FAILED


def _emit(result: AttemptResult, dry_run: bool) -> None:
    landed = not (dry_run and result.aborted_by is None)
    document: dict[str, Any] = {
        "outcome": result.outcome.value if landed else None,
        "triggered": result.triggered,
        "trigger": result.trigger,
        "aborted_by": result.aborted_by,
        "fell": result.fell,
        "accepted_mismatches": result.accepted_mismatches,
        "not_compared": result.not_compared,
        "diagnosis": result.diagnosis,
        "record": str(result.record),
    }
    emit(document, _in_words(document, dry_run))


def _in_words(document: dict[str, Any], dry_run: bool) -> str:
    record = f"record: {document['record']}"
    for key, words in (("not_compared", "not compared"), ("accepted_mismatches", "mismatch, accepted")):
        for sentence in reversed(document[key]):
            record = f"{words}: {sentence}\n{record}"
    if (diagnosis := document["diagnosis"]) is not None:
        record = f"{diagnosis['sentence']}\nnext: {diagnosis['next']}\n{record}"
    if document["fell"] is not None:
        record = f"{document['fell']}\n{record}"
    if document["aborted_by"] is not None:
        return f"aborted: {document['aborted_by']}\n{record}"
    if dry_run:
        return f"ready to fly: checks passed, policy uploaded and verified\n{record}"
    return f"outcome: {document['outcome']}\n{record}"
