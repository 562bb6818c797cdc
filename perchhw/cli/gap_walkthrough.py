"""``perchhw gap walkthrough``: a hidden change is found from the drone's own records, landings return."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from perchhw.cli.output import emit
from perchhw.consoles import progress_console

if TYPE_CHECKING:
    from perchhw.walkthrough.gap import Walkthrough


def walkthrough_command(
    out: Annotated[
        Path, typer.Option(help="Folder of the walk-through; finished steps in it are kept.")
    ] = Path("runs/walkthrough"),
    seed: Annotated[int, typer.Option(min=0, help="Of the lab, the finder and the learning.")] = 1,
) -> None:
    """Wear out the simulated drone in secret, find out what has changed, learn anew, land again.

    Takes about a quarter of an hour, most of it flights in real time.
    """
    from perchhw.walkthrough.gap import run_walkthrough

    screen = progress_console()
    result = run_walkthrough(out, seed, say=lambda text: screen.print(text, markup=False))
    emit(result, _in_words(result))


def _in_words(result: "Walkthrough") -> str:
    lines = ["hidden change, and what the gap finder says:"]
    found = result.found["effects"]
    for name in dict.fromkeys([*result.hidden, *found]):
        truth = result.hidden.get(name, {})
        values = found.get(name, {})
        for key in dict.fromkeys([*truth, *values]):
            said = values.get(key)
            interval = "" if said is None else f" ({said['ci95'][0]:.3g} to {said['ci95'][1]:.3g})"
            lines.append(
                f"  {name}.{key}: hidden {truth.get(key, 'nothing')}, "
                f"found {'nothing' if said is None else format(said['value'], '.3g')}{interval}"
            )
    lines.append("landing rate by rollouts (four legs, no contact of the body):")
    for sensing in result.landing_rates["believed"]:
        rates = [result.landing_rates[case][sensing]["clean"] for case in ("believed", "hidden", "relearned")]
        lines.append(
            f"  {sensing} cues: as filed {rates[0]:.2f}, changed {rates[1]:.2f}, learned anew {rates[2]:.2f}"
        )
    before, after = result.landings_in_the_lab["before"], result.landings_in_the_lab["after"]
    lines.append(
        f"landings in the lab: {before['clean']} of {before['attempts']} before, "
        f"{after['clean']} of {after['attempts']} after"
    )
    return "\n".join(lines)
