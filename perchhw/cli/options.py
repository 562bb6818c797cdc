"""Options that several verbs share, so that they read the same everywhere."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from calibration.flight_formats import FLIGHT_FORMATS
from perchhw.cli.environment import DRONE_VARIABLE, LAB_VARIABLE


def any_of(words: Sequence[str]) -> str:
    """``a, b or c``, for the help of an option."""
    return f"{', '.join(words[:-1])} or {words[-1]}"


DroneUri = Annotated[
    str, typer.Option(envvar=DRONE_VARIABLE, help="URI of the drone: udp://HOST:PORT, radio://..., usb://...")
]
Lab = Annotated[
    Path | None,
    typer.Option(
        envvar=LAB_VARIABLE, help="Lab file; default: lab.toml in the working folder, where there is one."
    ),
]
Policy = Annotated[str, typer.Option(help="Policy file, or the name of a shipped policy.")]
Vehicle = Annotated[str, typer.Option(help="Vehicle file, or the name of a known vehicle.")]
Legs = Annotated[str | None, typer.Option(help="Leg design instead of the vehicle's own.")]
Mavlink = Annotated[
    str | None,
    typer.Option(
        metavar="mavlink://HOST:PORT",
        help="Tell a ground station of the flight; ?key=FILE signs. It cannot command.",
    ),
]
Drones = Annotated[
    list[str] | None,
    typer.Option("--drone", help="Fly this drone instead of the file's; several take turns."),
]
Operator = Annotated[str | None, typer.Option(metavar="NAME", help="Who flies; kept with every record.")]
Note = Annotated[str | None, typer.Option(metavar="TEXT", help="What to remember; kept with every record.")]
AcceptMismatch = Annotated[
    bool,
    typer.Option(
        "--accept-mismatch",
        help="Fly also what does not belong together (policy, vehicle, ceiling, drone); the record says so.",
    ),
]
FlightFormat = Annotated[str, typer.Option("--format", help=f"{any_of(('auto', *FLIGHT_FORMATS))}.")]
