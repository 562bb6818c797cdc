"""Options that several verbs share, so that they read the same everywhere."""

from typing import Annotated

import typer

DroneUri = Annotated[str, typer.Option(help="URI of the drone: udp://HOST:PORT, radio://..., usb://...")]
Policy = Annotated[str, typer.Option(help="Policy file, or the name of a shipped policy.")]
Vehicle = Annotated[str, typer.Option(help="Vehicle file, or the name of a known vehicle.")]
Legs = Annotated[str | None, typer.Option(help="Leg design instead of the vehicle's own.")]
FlightFormat = Annotated[str, typer.Option("--format", help="auto, perchhw, habas, table, nanobench or usd.")]
