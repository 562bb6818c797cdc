"""``perchhw calibrate tachometer``: how fast the motors follow their commands."""

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
    Supply,
    needed,
    operator_of,
    run_folder,
    tell,
)
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.options import Vehicle

FromLog = Annotated[
    list[Path] | None,
    typer.Option("--from-log", help="Only fit recordings of one motor; more files may follow."),
]
More = Annotated[list[Path] | None, typer.Argument(metavar="[FILE]...", help="More of --from-log.")]
Propeller = Annotated[
    str,
    typer.Option(
        help="Speed to thrust: vehicle (the file's coefficient), P250, L250, T350, bitcraze-2015, foerster."
    ),
]


@with_option_groups
def tachometer_command(
    *,
    more: More = None,
    drone: Drone = None,
    tachometer: Annotated[str | None, typer.Option(help="Port of the tachometer: /dev/ttyACM0.")] = None,
    supply: Supply = None,
    voltage: Annotated[float, typer.Option(min=3.0, max=4.2, help="Of the supply, V.")] = 3.9,
    no_remote_cut: NoRemoteCut = False,
    vehicle: Vehicle = DEFAULT_VEHICLE,
    propeller: Propeller = "vehicle",
    out: Out = None,
    motors: Annotated[str, typer.Option(help="Motors in their order.")] = "1234",
    repeats: Annotated[int, typer.Option(min=1, help="Of the staircase of each motor.")] = 2,
    seed: Annotated[int, typer.Option(min=0, help="Of the order of the steps.")] = 0,
    helper: MotorHelperOptions,
    operator: Person = "",
    from_log: FromLog = None,
    blades: Annotated[int, typer.Option(min=1, help="With --from-log: marks per revolution.")] = 2,
) -> None:
    """Step the motors of a clamped drone and get their speed law and time constants.

    Motors turn only after 'props guarded, drone clamped' was typed (or given with --confirm), and stop on
    Ctrl-C, on a lost link and on a lost instrument. A supply is switched off by a process of its own when
    this one is killed or hangs; without a supply nothing turns unless --no-remote-cut says so and 'hand on
    the battery plug' was typed (or given with --confirm).
    """
    from calibration.bench.procedures.motors import KIND, MotorPlan
    from calibration.bench.procedures.sessions import Stand, measure_motors
    from onboard.vehicle import load_vehicle
    from perchhw.cli.bench_logs import fit_steps, propeller_of

    model = load_vehicle(vehicle)
    fitted = propeller_of(propeller, model)
    if from_log:
        fit_steps([*from_log, *(more or [])], model, fitted, blades)
        return
    plan = MotorPlan(model, fitted, motors, repeats, seed)
    uri = needed(drone, "--drone", "the URI of the clamped drone")
    port = needed(tachometer, "--tachometer", "the port of the tachometer")
    with run_folder(out, KIND) as folder, operator_of(helper) as person:
        stand = Stand(uri, port, supply, voltage, no_remote_cut)
        tell(measure_motors(plan, stand, folder, person, {"operator": operator}), folder)
