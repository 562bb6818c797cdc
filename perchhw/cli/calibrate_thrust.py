"""``perchhw calibrate thrust``: thrust against motor voltage."""

from pathlib import Path
from typing import Annotated

import typer

from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.cli.bench_options import (
    Drone,
    MotorHelperOptions,
    NoRemoteCut,
    Out,
    Person,
    Scale,
    Supply,
    needed,
    operator_of,
    run_folder,
    tell,
)
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.options import Vehicle

FromTable = Annotated[
    Path | None,
    typer.Option("--from-table", "--from-log", help="Only fit a table of thrust against voltage."),
]


@with_option_groups
def thrust_command(
    *,
    drone: Drone = None,
    scale: Scale = None,
    supply: Supply = None,
    no_remote_cut: NoRemoteCut = False,
    voltages: Annotated[
        str, typer.Option(help="Of the supply, V; two of them must fall on one curve.")
    ] = "3.4,3.9",
    levels: Annotated[int, typer.Option(min=8, help="Commands at each voltage.")] = 20,
    vehicle: Vehicle = DEFAULT_VEHICLE,
    out: Out = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the order of the commands.")] = 0,
    helper: MotorHelperOptions,
    operator: Person = "",
    from_table: FromTable = None,
    force_unit: Annotated[str, typer.Option(help="With --from-table: of the thrust: g, N, oz or kg.")] = "g",
    motors: Annotated[
        int | None, typer.Option(min=1, help="With --from-table: how many motors the thrust is of.")
    ] = None,
) -> None:
    """Let the drone push a scale and get its thrust map, chosen by cross-validation.

    Motors turn only after 'props guarded, drone clamped' was typed (or given with --confirm), and stop on
    Ctrl-C, on a lost link and on a lost instrument; the supply is switched off on every way out, by a process
    of its own also when this one is killed or hangs. With a supply that you set by hand nobody could: nothing
    turns then unless --no-remote-cut says so and 'hand on the battery plug' was typed.
    """
    from calibration.bench.procedures.operator import AnswerNotUsable
    from calibration.bench.procedures.sessions import Stand, measure_thrust
    from calibration.bench.procedures.thrust import KIND, ThrustPlan
    from onboard.vehicle import load_vehicle

    if from_table is not None:
        from perchhw.cli.bench_logs import fit_table

        fit_table(from_table, force_unit, motors)
        return
    try:
        volts = tuple(float(part) for part in voltages.split(","))
    except ValueError as error:
        raise AnswerNotUsable(
            f"--voltages {voltages}: write volts with commas between, as 3.4,3.9"
        ) from error
    if not all(3.0 <= one <= 4.3 for one in volts):
        raise AnswerNotUsable(f"--voltages {voltages}: a one-cell drone takes 3.0 to 4.3 V")
    plan = ThrustPlan(load_vehicle(vehicle), volts, levels, seed)
    uri = needed(drone, "--drone", "the URI of the drone on the stand")
    weigher = needed(scale, "--scale", "the scale that the drone pushes: loadcell://, mtsics:// or manual://")
    feed = needed(supply, "--supply", "the supply that feeds the drone: scpi://, korad:// or manual://")
    with run_folder(out, KIND) as folder, operator_of(helper) as person:
        stand = Stand(uri, weigher, feed, volts[0], no_remote_cut)
        tell(measure_thrust(plan, stand, folder, person, {"operator": operator}), folder)
