"""``perchhw doctor``: what a flight needs, line by line, with the remedy."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from perchhw.cli import exit_codes
from perchhw.cli.lab_options import LabDrone, LabMocap, LabVehicle
from perchhw.cli.options import Lab
from perchhw.cli.output import emit

if TYPE_CHECKING:
    from perchhw.doctor import CheckResult

app = typer.Typer(add_completion=False)


@app.command()
def doctor(
    lab: Lab = None,
    drone: LabDrone = None,
    mocap: LabMocap = None,
    vehicle: LabVehicle = None,
    out: Annotated[Path, typer.Option(help="Folder where records will go.")] = Path("runs"),
    seconds: Annotated[float, typer.Option(min=0.5, max=60.0, help="How long to listen.")] = 2.0,
) -> int:
    """Measure what a flight needs and say what is missing; the drone stands still on its start mark.

    Looks at what is named: a drone, motion capture, or both. Nothing is armed or set.

    Exit codes: 0 nothing is missing, 1 something is, 2 an address that cannot be used.
    """
    from onboard.vehicle import load_vehicle
    from perchhw.doctor import examine, take_readings
    from perchhw.lab.partial import addresses

    named = addresses(lab, drone, mocap, vehicle)
    readings = take_readings(
        drone=named.drone,
        mocap=named.mocap,
        vehicle=load_vehicle(named.vehicle),
        lab=named.lab,
        folder=out,
        seconds=seconds,
    )
    findings = examine(readings)
    missing = [finding.what for finding in findings if finding.missing]
    document = {
        "drone": named.drone,
        "mocap": named.mocap,
        "ok": not missing,
        "missing": missing,
        "findings": findings,
    }
    emit(document, "\n".join(map(in_words, findings)))
    return exit_codes.FAILED if missing else exit_codes.DONE


def in_words(finding: "CheckResult") -> str:
    """One line; why and what to do where something is missing."""
    line = f"{finding.verdict.value:8}{finding.what}: {finding.measured} (wanted: {finding.wanted})"
    return f"{line}\n        {finding.why}\n        -> {finding.remedy}" if finding.remedy else line
