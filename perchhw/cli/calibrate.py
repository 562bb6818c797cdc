"""``perchhw calibrate``: measure the real vehicle on the bench, and put what was measured into its file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from perchhw.cli.bench_walkthrough import walkthrough_command
from perchhw.cli.calibrate_bifilar import bifilar_command
from perchhw.cli.calibrate_capture import capture_command
from perchhw.cli.calibrate_discharge import discharge_command, verify_command
from perchhw.cli.calibrate_tachometer import tachometer_command
from perchhw.cli.calibrate_thrust import thrust_command
from perchhw.cli.options import Vehicle
from perchhw.cli.output import emit
from perchhw.consoles import progress_console

if TYPE_CHECKING:
    from calibration.bench.procedures.compare import Comparison

app = typer.Typer(
    add_completion=False, no_args_is_help=True, help="Measure inertia, motors, thrust and pads on the bench."
)
app.command("bifilar")(bifilar_command)
app.command("tachometer")(tachometer_command)
app.command("thrust")(thrust_command)
app.command("capture")(capture_command)
app.command("discharge")(discharge_command)
app.command("verify")(verify_command)
app.command("walkthrough")(walkthrough_command)

Runs = Annotated[list[Path], typer.Argument(metavar="RUN...", help="Folders of calibration runs.")]


@app.command()
def apply(
    runs: Runs,
    vehicle: Vehicle,
    out: Annotated[Path, typer.Option(help="Vehicle file to write; what it held before is kept.")],
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask after showing the changes.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Apply a run that its checks rejected.")] = False,
) -> int:
    """Put calibrations into a vehicle file: shows every change, asks, writes, keeps what was there before."""
    from calibration.bench.procedures.apply import changed_vehicle, write_applied
    from calibration.bench.procedures.calibration import ResultFileError, load_calibration
    from onboard.vehicle import load_vehicle
    from perchhw.cli.bench_operator import TerminalOperator
    from perchhw.cli.vehicle import differences, draw_differences

    calibrations = [load_calibration(run) for run in runs]
    for run, calibration in zip(runs, calibrations, strict=True):
        if (reasons := calibration.rejections) and not force:
            raise ResultFileError(f"{run}: was rejected by its checks: {'; '.join(reasons)}. Measure again")
    before = load_vehicle(vehicle)
    after = changed_vehicle(before, calibrations)
    rows = differences(before, after)
    draw_differences(progress_console(), vehicle, str(out), rows)
    agreed = TerminalOperator(yes=yes).agree(f"Write these {len(rows)} changes to {out}?")
    kept = write_applied(after, out) if agreed else None
    document = {
        "applied": agreed,
        "vehicle": out,
        "calibrations": [calibration.id for calibration in calibrations],
        "changes": rows,
        "kept": kept,
    }
    words = f"{out} written; `perchhw calibrate undo {out}` takes it back" if agreed else "nothing written"
    emit(document, words)
    return 0 if agreed else 1


@app.command()
def undo(
    file: Annotated[Path, typer.Argument(help="Vehicle file that calibrations were applied to.")],
) -> None:
    """Take the last applied calibration back."""
    from calibration.bench.procedures.apply import undo as take_back

    kept = take_back(file)
    emit({"vehicle": file, "restored_from": kept}, f"{file} is what it was before (from {kept.name})")


@app.command()
def compare(
    run: Annotated[Path, typer.Argument(help="Folder of a calibration run.")],
    other: Annotated[Path | None, typer.Argument(help="An earlier run.")] = None,
    vehicle: Annotated[str | None, typer.Option(help="Or a vehicle file.")] = None,
) -> int:
    """Hold a calibration against an earlier one or a vehicle file: E_n above 1 is a contradiction.

    Exit code 1 when something contradicts.
    """
    from calibration.bench.procedures.calibration import ResultFileError, load_calibration
    from calibration.bench.procedures.compare import compare_calibrations, compare_with_vehicle
    from onboard.vehicle import load_vehicle

    now = load_calibration(run)
    if (other is None) == (vehicle is None):
        raise ResultFileError("compare: say what to compare with: another run, or --vehicle FILE")
    if other is not None:
        rows = compare_calibrations(load_calibration(other), now)
    else:
        rows = compare_with_vehicle(load_vehicle(str(vehicle)), now)
    emit({"rows": rows}, _comparison_text(rows))
    return 1 if any(row.contradicts for row in rows) else 0


def _comparison_text(rows: "list[Comparison]") -> str:
    return "\n".join(
        f"{row.key}: {row.before} before, {row.now} now"
        + ("" if row.normalised is None else f", E_n {row.normalised:.2f}")
        + f": {row.verdict}"
        for row in rows
    )
