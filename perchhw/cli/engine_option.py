"""The option of verbs that serve simulated drones: which code they run."""

from typing import Annotated

import typer

from sim_backend.engine_name import EngineName

Engine = Annotated[
    EngineName | None,
    typer.Option(
        help="Code that the drones run: their own in C, or its reference. Default: c where a C compiler is "
        "found, else reference.",
        show_default=False,
    ),
]
