"""``perchhw calibrate walkthrough``: a drone that is not as its file says is measured, and flies better."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from perchhw.cli.output import emit
from perchhw.consoles import progress_console

if TYPE_CHECKING:
    from perchhw.walkthrough.bench import BenchWalkthrough


def walkthrough_command(
    out: Annotated[
        Path, typer.Option(help="Folder of the walk-through; finished steps in it are kept.")
    ] = Path("runs/bench-walkthrough"),
    seed: Annotated[int, typer.Option(min=0, help="Of bench, lab and learning.")] = 1,
) -> None:
    """Change the simulated drone in secret, calibrate it on the simulated bench, fly before and after.

    Takes about half an hour, most of it in real time.
    """
    from perchhw.walkthrough.bench import run_bench_walkthrough

    screen = progress_console()
    result = run_bench_walkthrough(out, seed, say=lambda text: screen.print(text, markup=False))
    emit(result, _in_words(result))


def _in_words(result: "BenchWalkthrough") -> str:
    lines = ["measured on the bench, and the truth:"]
    for row in result.measured:
        now, true = row["now"], row["before"]
        lines.append(
            f"  {row['key']}: {now['value']:.4g} ± {now['u95']:.2g} {now['unit']}, true {true['value']:.4g}"
        )
    lines.append("RMS distance from the course:")
    for kind, before in result.tracking_m["before"].items():
        after = result.tracking_m["after"][kind]
        lines.append(f"  {kind}: {1e3 * before:.0f} mm before, {1e3 * after:.0f} mm after")
    landed, again = result.landings_in_the_lab["before"], result.landings_in_the_lab["after"]
    lines.append(
        f"landings: {landed['clean']} of {landed['attempts']} before, {again['clean']} of "
        f"{again['attempts']} after"
    )
    return "\n".join(lines)
