"""Agreement of our sweep with the authors' own sweep of this design. Prints one JSON document.

    python benchmarks/agreement.py --reference NL_LR_Trials.csv [--repeats 15] [--seed 0]

Flies the presets that stand for the authors' simulation (docs/learning.md, Agreement) over their grid, three
repeats a sweep, and compares the map of the best of three with theirs: each sweep alone, and the median of
all. For comparison the same for the default vehicle, one sweep each with perfect and with realistic cues. The
ranges of the cues at the trigger are those of pairs that land in at least 80 %.
"""

import argparse
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from perchhw.learning.agreement import agreement, median_of_best
from perchhw.learning.bands import best_per_condition
from perchhw.learning.grid import parse_range
from perchhw.learning.results import RateMap, columns, read_reference
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid, run_sweep
from perchhw.learning.sweep_folder import Row

BEST_OF = 3
GAZEBO = LearningSetup(vehicle="crazyflie21-gazebo", reward="flown", sensing="gazebo", gains="gazebo")


def sweep(setup: LearningSetup, repeats: int) -> tuple[Row, ...]:
    """The rows of a sweep over the default grid."""
    speeds, angles = parse_range("1.5:3.5:0.1", "--speeds"), parse_range("30:90:3.75", "--angles")
    with tempfile.TemporaryDirectory() as folder:
        return run_sweep(setup, SweepGrid(speeds, angles, repeats), Path(folder) / "sweep").rows


def compared(rows: Sequence[Row], theirs: RateMap) -> dict[str, object]:
    """Each sweep alone, and the median of them."""
    last = max(int(row["trial"] or 0) for row in rows) + 1
    singles = [
        agreement(
            best_per_condition(tuple(row for row in rows if int(row["trial"] or 0) // BEST_OF == group)),
            theirs.rates,
        )
        for group in range(last // BEST_OF)
    ]
    return {
        "single_sweeps": [single._asdict() for single in singles],
        "median_of_sweeps": agreement(median_of_best(rows, BEST_OF), theirs.rates)._asdict(),
    }


def trigger_ranges(rows: Sequence[Row]) -> dict[str, list[float]]:
    """Least and greatest cue and moment of the pairs that land in at least 80 %."""
    good = tuple(row for row in rows if float(row["landing_rate"] or 0) >= 0.8)
    names = ("tau", "theta_x", "d_ceil", "a_rot")
    return {
        name: [float(values.min()), float(values.max())]
        for name, values in zip(names, columns(good, *names), strict=True)
    }


def main() -> None:
    """Sweep, compare and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--reference", type=Path, required=True, help="the authors' table NL_LR_Trials.csv")
    parser.add_argument("--repeats", type=int, default=15, help="a multiple of 3")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    theirs = read_reference(arguments.reference)
    vehicle = {**vars(GAZEBO), "seed": arguments.seed}
    gazebo = sweep(LearningSetup(**vehicle), arguments.repeats)
    document = {
        "benchmark": "agreement",
        "authors_simulation": compared(gazebo, theirs),
        "authors_simulation_trigger_ranges": trigger_ranges(gazebo),
    }
    for sensing in ("perfect", "realistic"):
        rows = sweep(LearningSetup(sensing=sensing, seed=arguments.seed), BEST_OF)
        document[f"{sensing}_cues"] = compared(rows, theirs)
        document[f"{sensing}_cues_trigger_ranges"] = trigger_ranges(rows)
    document["mean_rate_theirs"] = float(np.mean(list(theirs.rates.values())))
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
