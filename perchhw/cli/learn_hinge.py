"""``perchhw learn hinge``: which hinge of the legs agrees with the paper and its authors' sweep."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from perchhw.attempt import STORED_VEHICLE
from perchhw.cli.learn_options import GridOptions, OutOption, SeedOption
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.output import emit
from perchhw.consoles import console
from perchhw.screen.long_work import share_done

_OUT = Path("runs/hinge")


@dataclass(frozen=True)
class CoarseGrid(GridOptions):
    """A grid that every hinge can be flown on."""

    speeds: Annotated[str, typer.Option(help="m/s, FIRST:LAST:STEP or A,B,C.")] = "1.5:3.5:0.5"
    angles: Annotated[str, typer.Option(help="deg above the horizon, FIRST:LAST:STEP or A,B,C.")] = (
        "30:90:7.5"
    )


@with_option_groups
def hinge(
    reference: Annotated[Path, typer.Option(help="The authors' sweep (NL_LR_Trials.csv).")],
    grid: CoarseGrid,
    repeats: Annotated[int, typer.Option(help="Learning trials at each condition.")] = 3,
    vehicle: Annotated[str, typer.Option(help="Vehicle: a known name or a vehicle file.")] = STORED_VEHICLE,
    stiffnesses: Annotated[str, typer.Option(help="N m/rad, A,B,C; around 0.08 without it.")] = "",
    dampings: Annotated[str, typer.Option(help="N m s/rad, A,B,C; 6.788e-5 (the authors') without it.")] = "",
    sensing: Annotated[
        str, typer.Option(help="Errors of the cues: gazebo (the authors'), perfect, realistic or late.")
    ] = "gazebo",
    seed: SeedOption = 0,
    out: OutOption = _OUT,
) -> None:
    """Scan one hinge for all leg designs against the paper's statements and the authors' sweep."""
    from perchhw.learning.authors_models import AUTHORS_DAMPING
    from perchhw.learning.grid import parse_range
    from perchhw.learning.hinge_calibration import (
        STIFFNESSES,
        Hinge,
        run_hinge_calibration,
    )
    from perchhw.learning.setup import LearningSetup
    from perchhw.learning.sweep import SweepGrid

    k = parse_range(stiffnesses, "--stiffnesses") if stiffnesses else STIFFNESSES
    c = parse_range(dampings, "--dampings") if dampings else (AUTHORS_DAMPING,)
    with grid.executor() as executor, share_done("hinges") as show:
        result = run_hinge_calibration(
            LearningSetup(vehicle=vehicle, reward="flown", gains="gazebo", sensing=sensing, seed=seed),
            [Hinge(stiffness, damping) for damping in c for stiffness in k],
            SweepGrid(*grid.ranges(), repeats),
            reference,
            out,
            executor=executor,
            on_hinge=show,
        )
    emit(result, lambda: _draw(result))


def _draw(result: dict[str, Any]) -> None:
    from rich.table import Table

    table = Table(title="score of a hinge (0 at most)", title_justify="left")
    for heading in ("N m/rad", "N m s/rad", "statements", "their sweep", "both", "picked"):
        table.add_column(heading)
    for point in result["scan"]:
        scores = [f"{point[name]:.1f}" for name in ("score_statements", "score_reference", "score")]
        table.add_row(
            f"{point['stiffness']:g}", f"{point['damping']:g}", *scores, f"{100 * point['picked']:.0f} %"
        )
    console().print(table)
    stiffness = result["stiffness"]
    low, high = stiffness["bootstrap_90"]
    console().print(
        f"stiffness {stiffness['value']:g} N m/rad; bootstrap over conditions {low:g} to {high:g} (90 %)",
        markup=False,
    )
