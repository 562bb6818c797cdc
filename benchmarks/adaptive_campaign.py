"""How many attempts an adaptive campaign saves, on drawn maps of the landing rate.

    python benchmarks/adaptive_campaign.py [--maps 4] [--repeats 3] [--seed 0]

Truth: maps of five shapes over 7 speeds and 6 angles (tests/campaign/drawn_maps.py), none of the
surrogate's family. A grid flies every condition `repeats` times. Its map is judged twice: by the share of
landings at each condition, and smoothed by the surrogate of the adaptive campaign. Errors are root mean
squares over conditions and maps. The adaptive campaign, and a shuffled grid that is broken off, have 60 % of
the attempts. Shares are those of the attempts from which on the adaptive campaign's error stays below the
grid's (null: more than all of them). Prints one JSON document.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.campaign.drawn_maps import SHAPES, DrawnMap

CONDITIONS = [(float(speed), float(angle)) for speed in np.linspace(2, 3, 7) for angle in range(30, 61, 6)]
SHARE = 0.6
CHECKED = 20
"""Places along a campaign where its map is judged."""


def study(shape: str, seeds: list[int], repeats: int) -> dict[str, Any]:
    """Mean square errors over the maps of one shape; ``adaptive`` along the campaign."""
    most = repeats * len(CONDITIONS)
    checks = [round(most * k / CHECKED) for k in range(1, CHECKED + 1)]
    errors: dict[str, list[Any]] = {name: [] for name in ("grid", "smoothed", "shuffled", "path", "expected")}
    for seed in seeds:
        truth = DrawnMap(shape, CONDITIONS, seed, most)
        every = truth.grid(repeats)
        errors["grid"].append(truth.error(truth.landed(every) / every))
        errors["smoothed"].append(truth.error(truth.known(every).rate))
        shuffled = truth.shuffled(repeats, round(SHARE * most))
        errors["shuffled"].append(truth.error(truth.known(shuffled).rate))
        steps = truth.chosen(most)
        maps = [truth.known(steps[n - 1]) for n in checks]
        errors["path"].append([truth.error(known.rate) for known in maps])
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
    }


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=4, help="of each shape")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0, help="of the first map")
    asked = parser.parse_args()
    seeds = list(range(asked.seed, asked.seed + asked.maps))
    shapes = {shape: study(shape, seeds, asked.repeats) for shape in SHAPES}
    together = {name: [e for errors in shapes.values() for e in errors[name]] for name in shapes["cliff"]}
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
