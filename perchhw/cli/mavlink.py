"""``perchhw mavlink``: a drone or a record, as a ground station sees it."""

from pathlib import Path
from typing import Annotated

import typer

from onboard.errors import InputError
from perchhw.cli import exit_codes
from perchhw.cli.output import emit
from perchhw.errors import FlightStackError

app = typer.Typer(add_completion=False, no_args_is_help=True, help="MAVLink: telemetry for a ground station.")


class NothingToServe(FlightStackError, InputError):
    """Neither a drone nor a record was given, or both."""


@app.callback()
def mavlink() -> None:
    """MAVLink: telemetry for a ground station."""


@app.command()
def serve(
    to: Annotated[
        str, typer.Option(metavar="mavlink://HOST:PORT", help="The ground station; ?key=FILE signs.")
    ] = "mavlink://127.0.0.1:14550",
    drone: Annotated[
        str | None, typer.Option(help="URI of a drone with which no other program of perchhw talks.")
    ] = None,
    record: Annotated[
        Path | None, typer.Option(help="Folder of a run, also one that is being written.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.1, help="How long at most; default: until interrupted.")
    ] = None,
) -> int:
    """Tell a ground station of a drone, or of a record: one that grows is followed, a finished one is played.

    It cannot command. Exit code 1 when the drone was lost, or nothing could be sent.
    """
    from mocap_bridge.mavlink.address import parse_mavlink_address
    from mocap_bridge.mavlink.telemetry import MavlinkTelemetry
    from perchhw.flight.ground_station import GroundStation
    from perchhw.flight.live_drone import tell_drone
    from perchhw.flight.record_playback import play_record

    if (drone is None) == (record is None):
        raise NothingToServe("mavlink serve: give one of --drone URI and --record RUN")
    address, limit = parse_mavlink_address(to), seconds or float("inf")
    with MavlinkTelemetry(address) as telemetry:
        listener = GroundStation(telemetry)
        if drone is not None:
            tell_drone(drone, listener, limit)
        if record is not None:
            play_record(record, listener, limit)
    result = {"to": str(address), "sent": telemetry.sent, "lost": telemetry.lost}
    emit(result, "\n".join(f"{name}: {value}" for name, value in result.items()))
    return exit_codes.DONE if telemetry.sent > telemetry.lost else exit_codes.FAILED
