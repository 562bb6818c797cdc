"""``perchhw stop``: cut the motors, from any terminal, beside whoever flies."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from onboard.errors import InputError, PerchhwError
from onboard.link.errors import LinkInputError
from onboard.link.stop import StopReport
from onboard.link.stop_drone import stop_drone
from perchhw.cli import exit_codes
from perchhw.cli.output import emit

LAB_FILE = Path("lab.toml")
"""The lab file of a folder."""

app = typer.Typer(add_completion=False)


@app.command()
def stop(
    drone: Annotated[
        list[str] | None,
        typer.Option(help="URI of the drone; may be repeated. Goes before --lab."),
    ] = None,
    lab: Annotated[
        Path | None, typer.Option(help="Lab file whose drones are all stopped. Default: lab.toml, here.")
    ] = None,
) -> int:
    """Cut the motors of drones now, and repeat it until each says that it is locked (until it is rebooted).

    It has a connection of its own, waits for no lock, and does not ask: a drone in the air falls.

    Exit codes: 0 all are locked, 1 not confirmed, 2 no drone was named, or not in a way that can be used.
    """
    uris = drones_to_stop(drone, lab)
    with ThreadPoolExecutor(len(uris)) as threads:
        results = list(threads.map(_stopped, uris))
    emit({"drones": [told for told, _ in results]}, "\n".join(_in_words(told) for told, _ in results))
    return max(code for _, code in results)


def drones_to_stop(drone: list[str] | None, lab: Path | None) -> list[str]:
    """The URIs that were given, or else those of the lab file: the one given, or that of this folder.

    Raises:
        LinkInputError: neither is there.
        LabFileError: the lab file names no drones.
    """
    if drone:
        return list(dict.fromkeys(drone))
    from onboard.lab_file import drone_uris

    if lab is None and not LAB_FILE.exists():
        raise LinkInputError(f"no drone to stop: give --drone URI, or --lab FILE (here is no {LAB_FILE})")
    return list(dict.fromkeys(drone_uris(lab or LAB_FILE)))


def _stopped(uri: str) -> tuple[dict[str, Any], int]:
    """What came of one stop, and its exit code. One drone out of reach does not keep the others flying."""
    try:
        report = stop_drone(uri)
        code = exit_codes.DONE if report.locked else exit_codes.FAILED
    except PerchhwError as error:
        report = StopReport(locked=False, reason=str(error), seconds=0.0, copies=0)
        code = exit_codes.USAGE if isinstance(error, InputError) else exit_codes.FAILED
    return {"drone": uri, **asdict(report)}, code


def _in_words(result: dict[str, Any]) -> str:
    if result["locked"]:
        return f"{result['drone']}: locked after {1000.0 * result['seconds']:.0f} ms"
    return f"{result['drone']}: NOT CONFIRMED: {result['reason']}"
