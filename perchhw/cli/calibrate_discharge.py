"""``perchhw calibrate discharge`` and ``verify``: does the thrust stay while the voltage falls?"""

from pathlib import Path
from typing import Annotated, Any

import typer

from onboard.json_file import as_json
from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.cli.bench_options import (
    Drone,
    MotorHelperOptions,
    NoRemoteCut,
    Out,
    Scale,
    Supply,
    needed,
    operator_of,
    run_folder,
)
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.options import Vehicle
from perchhw.cli.output import emit


@with_option_groups
def discharge_command(
    *,
    drone: Drone = None,
    scale: Scale = None,
    supply: Supply = None,
    no_remote_cut: NoRemoteCut = False,
    vehicle: Vehicle = DEFAULT_VEHICLE,
    out: Out = None,
    helper: MotorHelperOptions,
) -> int:
    """Record a discharge with the battery compensation on, the map of --vehicle on the drone; and judge it.

    On a supply the voltage is lowered from 4.2 to 3.2 V at two thrusts; on a battery, which needs
    --no-remote-cut, the drone hovers against the scale until it is empty. Motors as in `calibrate thrust`.
    Exit code 1 when the thrust was not what was asked for.
    """
    from calibration.bench.procedures.discharge import FULL_V, KIND, DischargePlan
    from calibration.bench.procedures.sessions import Stand, measure_discharge
    from onboard.vehicle import load_vehicle

    plan = DischargePlan(load_vehicle(vehicle))
    uri = needed(drone, "--drone", "the URI of the drone on the stand")
    weigher = needed(scale, "--scale", "the scale that the drone pushes: loadcell://, mtsics:// or manual://")
    with run_folder(out, KIND) as folder, operator_of(helper) as person:
        stand = Stand(uri, weigher, supply, FULL_V, no_remote_cut)
        measure_discharge(plan, stand, folder, person)
    return verify_command(folder)


def verify_command(
    file: Annotated[
        Path,
        typer.Argument(
            help="Run of `calibrate discharge`, or a table: t_s,battery_v,asked_gf,command,scale_g,motors"
        ),
    ],
    report: Annotated[
        Path | None, typer.Option(help="Write a page with the figure. [of a run: its report.html]")
    ] = None,
) -> int:
    """Judge a recorded discharge with the battery compensation on: 3 % or 0.15 gf until the motors saturate.

    Exit code 1 when the thrust was not what was asked for.
    """
    from calibration.bench.procedures.discharge import TABLE_FILE
    from calibration.bench.procedures.discharge_report import write_discharge_report
    from calibration.bench.procedures.report import REPORT_FILE
    from calibration.bench.thrust.compensation import read_discharge, verify

    if file.is_dir():
        report = report or file / REPORT_FILE
        file = file / TABLE_FILE
    discharge = read_discharge(file)
    verdict = verify(discharge)
    document: dict[str, Any] = as_json(verdict) | {"table": file, "report": None}
    below = verdict.saturated_below
    words = [
        f"{document['readings']} readings, largest error {verdict.worst_gf:.2f} gf "
        f"({100.0 * verdict.worst_relative:.1f} %): {'passed' if verdict.passed else 'not passed'}",
        "never saturated" if below is None else f"saturated at {below:.2f} V and below",
        *(f"! {finding.text}" for finding in verdict.findings),
    ]
    if report is not None:
        document["report"] = write_discharge_report(report, discharge, verdict)
        words.append(f"report: {report}")
    emit(document, "\n".join(words))
    return 0 if verdict.passed else 1
