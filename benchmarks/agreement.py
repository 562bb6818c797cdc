"""Agreement of our sweep with the authors' own sweep of this design. Prints one JSON document.

    python benchmarks/agreement.py --reference NL_LR_Trials.csv [--repeats 15] [--seed 0]

Flies the presets that stand for the authors' simulation (docs/learning.md, Agreement) over their grid, three
repeats a sweep, and compares the map of the best of three with theirs: each sweep alone, and the median of
all (`perchhw learn agreement` does that for any design). For comparison the same for our vehicle with feet
that always hold, as theirs do, one sweep each with perfect and with realistic cues. The ranges of the cues at
the trigger are those of pairs that land in at least 80 %.
"""

import argparse
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from perchhw.attempt import STORED_VEHICLE
from perchhw.learning.agreement import BEST_OF, agreement_of_sweeps
from perchhw.learning.grid import parse_range
from perchhw.learning.results import columns, read_reference
from perchhw.learning.setup import LearningSetup
from perchhw.learning.sweep import SweepGrid, run_sweep
from perchhw.learning.sweep_folder import Row

GAZEBO = LearningSetup(vehicle="crazyflie21-gazebo", reward="flown", sensing="gazebo", gains="gazebo")


def sweep(setup: LearningSetup, repeats: int) -> tuple[Row, ...]:
    """The rows of a sweep over the default grid."""
    speeds, angles = parse_range("1.5:3.5:0.1", "--speeds"), parse_range("30:90:3.75", "--angles")
    with tempfile.TemporaryDirectory() as folder:
        return run_sweep(setup, SweepGrid(speeds, angles, repeats), Path(folder) / "sweep").rows


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
        "authors_simulation": agreement_of_sweeps(gazebo, theirs.rates),
        "authors_simulation_trigger_ranges": trigger_ranges(gazebo),
    }
    for sensing in ("perfect", "realistic"):
        rows = sweep(LearningSetup(vehicle=STORED_VEHICLE, sensing=sensing, seed=arguments.seed), BEST_OF)
        document[f"{sensing}_cues"] = agreement_of_sweeps(rows, theirs.rates)
        document[f"{sensing}_cues_trigger_ranges"] = trigger_ranges(rows)
    document["mean_rate_theirs"] = float(np.mean(list(theirs.rates.values())))
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
