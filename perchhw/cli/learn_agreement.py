"""``perchhw learn agreement``: a sweep of ours against a table of landing rates."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from perchhw.cli.learn_options import AuthorsOptions, GridOptions, progress_of
from perchhw.cli.option_groups import with_option_groups
from perchhw.cli.output import emit
from perchhw.consoles import console

if TYPE_CHECKING:
    from perchhw.learning.setup import LearningSetup


@with_option_groups
def agreement(
    reference: Annotated[
        Path, typer.Option(help="Table of landing rates: a sweep of the authors, or pairs.csv of ours.")
    ],
    setup: AuthorsOptions,
    grid: GridOptions,
    reward: Annotated[str, typer.Option(help="flown, later (their NS and WS sweeps), or paper.")] = "flown",
    repeats: Annotated[int, typer.Option(help="Learning trials at each condition, a multiple of 3.")] = 15,
    out: Annotated[Path, typer.Option(help="Folder for the sweep, and for agreement.json.")] = Path(
        "runs/agreement"
    ),
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the sweep in the folder.")] = False,
) -> None:
    """Learn pairs as the authors' simulation did, and say how far the landing rates agree with a table."""
    result = _compare(reference, setup.learning_setup(reward), grid, repeats, out, resume)
    emit(result, lambda: _draw(result))


def _compare(
    reference: Path, setup: "LearningSetup", grid: GridOptions, repeats: int, out: Path, resume: bool
) -> dict[str, Any]:
    from perchhw.learning.agreement import agreement_of_sweeps
    from perchhw.learning.results import read_reference
    from perchhw.learning.sweep import SweepGrid, run_sweep
    from perchhw.learning.sweep_folder import write_document

    theirs = read_reference(reference)
    with grid.executor() as executor, progress_of("learning trials", setup.seed) as show:
        rows = run_sweep(
            setup,
            SweepGrid(*grid.ranges(), repeats),
            out,
            executor=executor,
            resume=resume,
            on_trial=show,
        ).rows
    found = {
        "reference": str(reference),
        "settings": setup.describe(),
        **agreement_of_sweeps(rows, theirs.rates),
    }
    write_document(out / "agreement.json", found)
    return found


def _draw(result: dict[str, Any]) -> None:
    from rich.table import Table

    table = Table("", "rank correlation", "smoothed", "mean difference", "bias", box=None, pad_edge=False)
    named = [("median of sweeps", result["median_of_sweeps"])]
    named += [(f"sweep {number}", one) for number, one in enumerate(result["single_sweeps"], start=1)]
    for name, one in named:
        table.add_row(
            name,
            f"{one['spearman']:.2f}",
            f"{one['smoothed_spearman']:.2f}",
            f"{one['mean_difference']:.3f}",
            f"{one['bias']:+.3f}",
        )
    console().print(table)
    console().print(f"{result['median_of_sweeps']['conditions']} conditions; best of three repeats each")
