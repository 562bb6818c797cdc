"""``perchhw fly``: one supervised landing attempt."""

from pathlib import Path
from typing import Annotated, Any

import typer

from perchhw.attempt import (
    DEFAULT_POLICY,
    DEFAULT_VEHICLE,
    AttemptInterrupted,
    AttemptRequest,
    AttemptResult,
)
from perchhw.cli import exit_codes
from perchhw.cli.options import DroneUri, Legs, Policy, Vehicle
from perchhw.cli.output import emit, show_flight

app = typer.Typer(add_completion=False)


@app.command()
def fly(
    drone: DroneUri,
    mocap: Annotated[str, typer.Option(help="URI of the mocap stream: vicon://HOST[:PORT]?subject=NAME")],
    speed: Annotated[float, typer.Option(help="Speed on the approach line, m/s.")],
    angle: Annotated[float, typer.Option(help="Angle of the approach line above the horizon, deg.")],
    policy: Policy = DEFAULT_POLICY,
    vehicle: Vehicle = DEFAULT_VEHICLE,
    legs: Legs = None,
    ceiling: Annotated[float, typer.Option(help="Height of the ceiling, m.")] = 2.10,
    out: Annotated[Path, typer.Option(help="Folder for the record (a new folder inside it).")] = Path("runs"),
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Check and upload; never arm.")] = False,
    put_back: Annotated[
        bool, typer.Option("--put-back", help="First put the drone back on its start mark and reboot it.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask whether it stands there.")] = False,
) -> int:
    """Fly one attempt: check, upload and verify, arm, take off, approach, land upside down, label.

    A drone that has landed needs --put-back before it flies again.

    Exit codes: 0 landed (or the dry run passed), 1 not landed, 3 a safety rule refused or ended it.
    """
    from onboard.room import RoomGeometry
    from perchhw.cli.prompts import confirmation
    from perchhw.flight import fly_attempt, turnaround
    from perchhw.record import discard_if_empty, new_run_folder

    request = AttemptRequest(
        speed=speed,
        angle_deg=angle,
        index=0,
        folder=new_run_folder(out, f"fly-{speed:g}ms-{angle:g}deg"),
        drone=drone,
        mocap=mocap,
        policy=policy,
        vehicle=vehicle,
        legs=legs,
        room=RoomGeometry(ceiling_z=ceiling),
    )
    try:
        if put_back:
            turnaround.put_back(drone, confirmation(yes))
        result = fly_attempt(request, dry_run=dry_run, on_phase=show_flight)
    except AttemptInterrupted as interrupted:
        _emit(interrupted.result, dry_run)
        raise
    finally:
        discard_if_empty(request.folder)
    _emit(result, dry_run)
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
        "record": str(result.record),
    }
    emit(document, _in_words(document, dry_run))


def _in_words(document: dict[str, Any], dry_run: bool) -> str:
    if document["aborted_by"] is not None:
        return f"aborted: {document['aborted_by']}\nrecord: {document['record']}"
    if dry_run:
        return f"ready to fly: checks passed, policy uploaded and verified\nrecord: {document['record']}"
    return f"outcome: {document['outcome']}\nrecord: {document['record']}"
