"""Options of the verbs that take the rest from the environment and then from the lab file."""

from typing import Annotated

import typer

from perchhw.attempt import DEFAULT_POLICY, DEFAULT_VEHICLE
from perchhw.cli.environment import (
    DRONE_VARIABLE,
    LEGS_VARIABLE,
    MOCAP_VARIABLE,
    POLICY_VARIABLE,
    VEHICLE_VARIABLE,
)

_OF_LAB = "Default: that of the lab file"

LabDrone = Annotated[str | None, typer.Option(envvar=DRONE_VARIABLE, help=f"URI of the drone. {_OF_LAB}.")]
LabMocap = Annotated[
    str | None,
    typer.Option(
        envvar=MOCAP_VARIABLE, help=f"URI of the poses: vicon://HOST[:PORT]?subject=NAME. {_OF_LAB}."
    ),
]
LabPolicy = Annotated[
    str | None,
    typer.Option(
        envvar=POLICY_VARIABLE,
        help=f"Policy file, or name of a shipped one. {_OF_LAB}, or {DEFAULT_POLICY!r}.",
    ),
]
LabVehicle = Annotated[
    str | None,
    typer.Option(
        envvar=VEHICLE_VARIABLE,
        help=f"Vehicle file, or name of a known one. {_OF_LAB}, or {DEFAULT_VEHICLE!r}.",
    ),
]
LabLegs = Annotated[
    str | None,
    typer.Option(envvar=LEGS_VARIABLE, help=f"Leg design. {_OF_LAB}, or of the vehicle itself."),
]
