"""How many attempts an adaptive campaign saves, on drawn maps of the landing rate.

    python benchmarks/adaptive_campaign.py [--maps 4] [--repeats 3] [--seed 0] [--sweeps DIR]

Truth: maps of five shapes over 7 speeds and 6 angles (tests/campaign/drawn_maps.py), none of the
surrogate's family; with `--sweeps`, apart from these, the best rates of the tables `*_LR_Trials*.csv` of the
paper's authors there, each over two grids of that size. A grid flies every condition `repeats` times. Its
map is judged twice: by the share of landings at each condition, and smoothed by the surrogate of the adaptive
campaign. Errors are root mean squares over conditions and maps. The adaptive campaign, and a shuffled grid
that is broken off, have 60 % of the attempts. Shares are those of the attempts from which on the adaptive
campaign's error stays below the grid's (null: more than all of them). The last one is what knowledge of the
truth would give without smoothing: the share with which the mean variance of the shares of landings would
be the grid's, if attempts went to each condition as its standard deviation asks (Neyman's allocation). Prints
one JSON document.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))


from perchhw.learning.results import read_reference
from tests.campaign.drawn_maps import SHAPES, DrawnMap, KnownMap

CONDITIONS = [(float(speed), float(angle)) for speed in np.linspace(2, 3, 7) for angle in range(30, 61, 6)]
SHARE = 0.6
CHECKED = 20
"""Places along a campaign where its map is judged."""


SWEPT = [
    [(round(1.5 + 0.3 * i + 0.1 * grid, 2), 30.0 + 7.5 * j + 3.75 * grid) for i in range(7) for j in range(6)]
    for grid in (0, 1)
]
"""Two grids of the authors' sweeps that have no condition in common."""


def drawn(shape: str, seeds: list[int], repeats: int) -> Iterator[KnownMap]:
    """The maps of one shape."""
    for seed in seeds:
        yield DrawnMap(shape, CONDITIONS, seed, repeats * len(CONDITIONS))


def swept(folder: Path, seed: int, repeats: int) -> Iterator[KnownMap]:
    """The authors' sweeps as truths.

    Raises:
        PerchhwError: a table that cannot be read.
    """
    for number, table in enumerate(sorted(folder.glob("*_LR_Trials*.csv"))):
        rates = read_reference(table).rates
        for grid, conditions in enumerate(SWEPT):
            rate = np.array([rates[condition] for condition in conditions])
            rng = np.random.default_rng([seed, number, grid])
            yield KnownMap(rate, conditions, rng, repeats * len(conditions))


def study(truths: Iterable[KnownMap], repeats: int) -> dict[str, Any]:
    """Mean square errors over maps of the size of the grid; ``path`` along the adaptive campaign."""
    most = repeats * len(CONDITIONS)
    checks = [round(most * k / CHECKED) for k in range(1, CHECKED + 1)]
    names = ("grid", "smoothed", "shuffled", "path", "expected", "deviation", "variance")
    errors: dict[str, list[Any]] = {name: [] for name in names}
    for truth in truths:
        every = truth.grid(repeats)
        errors["grid"].append(truth.error(truth.landed(every) / every))
        errors["smoothed"].append(truth.error(truth.known(every).rate))
        shuffled = truth.shuffled(repeats, round(SHARE * most))
        errors["shuffled"].append(truth.error(truth.known(shuffled).rate))
        steps = truth.chosen(most)
        maps = [truth.known(steps[n - 1]) for n in checks]
        errors["path"].append([truth.error(known.rate) for known in maps])
        variance = truth.rate * (1.0 - truth.rate)
        errors["variance"].append(np.mean(variance))
        errors["deviation"].append(np.mean(np.sqrt(variance)) ** 2)
        errors["expected"].append(maps[round(SHARE * CHECKED) - 1].error ** 2)
    return errors


def summary(errors: dict[str, list[Any]]) -> dict[str, Any]:
    """Root mean squares over maps, and the shares of the grid's attempts that do."""
    rms = {name: np.sqrt(np.mean(values, axis=0)) for name, values in errors.items()}
    path = rms["path"]

    def share(error: float) -> float | None:
        above = np.flatnonzero(path > error)
        first = above[-1] + 1 if above.size else 0
        return None if first == CHECKED else (first + 1) / CHECKED

    return {
        "grid_shares": float(rms["grid"]),
        "grid_smoothed": float(rms["smoothed"]),
        "shuffled_smoothed_at_60_percent": float(rms["shuffled"]),
        "adaptive_at_60_percent": float(path[round(SHARE * CHECKED) - 1]),
        "adaptive_expected_at_60_percent": float(rms["expected"]),
        "share_for_the_error_of_grid_shares": share(rms["grid"]),
        "share_for_the_error_of_grid_smoothed": share(rms["smoothed"]),
        "share_of_attempts_placed_by_the_truth": float((rms["deviation"] / rms["variance"]) ** 2),
    }


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=4, help="of each shape")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0, help="of the first map")
    parser.add_argument("--sweeps", type=Path, help="folder of the authors' sweeps")
    asked = parser.parse_args()
    seeds = list(range(asked.seed, asked.seed + asked.maps))
    shapes = {shape: study(drawn(shape, seeds, asked.repeats), asked.repeats) for shape in SHAPES}
    together = {name: [e for errors in shapes.values() for e in errors[name]] for name in shapes["cliff"]}
    if asked.sweeps is not None:
        shapes["sweeps"] = study(swept(asked.sweeps, asked.seed, asked.repeats), asked.repeats)
    document = {
        "benchmark": "adaptive_campaign",
        "maps_of_each_shape": asked.maps,
        "grid_attempts": asked.repeats * len(CONDITIONS),
        "all": summary(together),
        "shapes": {shape: summary(errors) for shape, errors in shapes.items()},
    }
    json.dump(document, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
