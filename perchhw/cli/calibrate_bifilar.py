"""``perchhw calibrate bifilar``: the moments of inertia from swings between two strings."""

from pathlib import Path
from typing import Annotated

import typer

from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.cli.bench_options import (
    Drone,
    HelperOptions,
    Out,
    Person,
    needed,
    operator_of,
    run_folder,
    tell,
)
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.options import Vehicle

FromLog = Annotated[
    list[Path] | None,
    typer.Option("--from-log", help="Only fit recorded swings about one axis; more files may follow."),
]
More = Annotated[list[Path] | None, typer.Argument(metavar="[FILE]...", help="More of --from-log.")]
Measured = Annotated[str | None, typer.Option(help="With --from-log; SI, or with its unit: '594 mm'.")]


@with_option_groups
def bifilar_command(
    *,
    more: More = None,
    drone: Drone = None,
    vehicle: Vehicle = DEFAULT_VEHICLE,
    out: Out = None,
    axes: Annotated[str, typer.Option(help="Body axes to hang by, in their order.")] = "zxy",
    trials: Annotated[
        int, typer.Option(min=1, help="Swings about each axis; below 4 nothing is claimed.")
    ] = 5,
    cycles: Annotated[int, typer.Option(min=8, help="Cycles of each swing.")] = 20,
    tools: Annotated[
        str | None,
        typer.Option(help="What measures lengths and masses: jig or ruler. [jig; with --from-log ruler]"),
    ] = None,
    jig: Annotated[
        bool, typer.Option("--jig", help="The drone hangs in a jig that weighs something.")
    ] = False,
    helper: HelperOptions,
    operator: Person = "",
    from_log: FromLog = None,
    axis: Annotated[str | None, typer.Option(help="With --from-log: x, y or z.")] = None,
    mass: Measured = None,
    string_length: Measured = None,
    string_distance: Measured = None,
    estimator: Annotated[
        str, typer.Option(help="With --from-log: pendulum, or paper (the authors' peaks) beside it.")
    ] = "pendulum",
) -> None:
    """Hang the drone from two strings, twist it, and get its inertia with an honest interval.

    A run can be paused (Ctrl-C) and goes on in the same --out. With --from-log the fit alone.
    """
    if from_log:
        from perchhw.cli.bench_logs import fit_swings

        given = {
            "axis": axis,
            "mass": mass,
            "string-length": string_length,
            "string-distance": string_distance,
        }
        fit_swings([*from_log, *(more or [])], given, tools or "ruler", estimator)
        return
    from calibration.bench.procedures.inertia import KIND, InertiaPlan
    from calibration.bench.procedures.sessions import measure_inertia
    from onboard.vehicle import load_vehicle

    plan = InertiaPlan(load_vehicle(vehicle), axes, trials, cycles, tools or "jig", jig)
    uri = needed(drone, "--drone", "the URI of the drone that hangs")
    with run_folder(out, KIND) as folder, operator_of(helper) as person:
        tell(measure_inertia(plan, uri, folder, person, {"operator": operator}), folder)
