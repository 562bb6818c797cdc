"""``perchhw calibrate capture``: the normal speed at which a foot sticks."""

from pathlib import Path
from typing import Annotated

import typer

from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.cli.bench_options import Out, Person, run_folder, tell
from perchhw.cli.options import Vehicle


def capture_command(
    drops: Annotated[
        Path,
        typer.Option(
            "--from-table",
            "--from-log",
            help="Drops: speed_m_s (or height_m) and stuck (yes, no), or counts thrown and stuck by speed.",
        ),
    ],
    vehicle: Vehicle = DEFAULT_VEHICLE,
    out: Out = None,
    operator: Person = "",
) -> None:
    """Fit the normal speed at which a foot sticks to a leg that was dropped on the board, and its spread.

    Says which speeds to drop at next. `calibrate apply` puts the numbers into a vehicle file (pad_capture).
    """
    from calibration.bench.capture.advice import next_drops
    from calibration.bench.capture.drops import read_drops
    from calibration.bench.capture.fit import fit_drops
    from calibration.bench.procedures.sessions import conclude_capture
    from onboard.vehicle import load_vehicle
    from perchhw.cli.bench_operator import TerminalOperator

    compared = load_vehicle(vehicle)
    fit = fit_drops(read_drops(drops))
    advice = next_drops(fit)
    provenance = {"operator": operator, "table": str(drops)}
    with run_folder(out, "capture") as folder:
        concluded = conclude_capture(fit, drops, compared, folder, TerminalOperator(), provenance)
        tell(concluded, folder, {"next": str(advice)})
