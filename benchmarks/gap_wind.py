"""Judge the gap finder by kilogram-class vehicles in steady wind, drawn at random from another program.

    python benchmarks/gap_wind.py --runs 10 --table FILE [--first N]

Seeds follow from the commit of the finder, so that nobody can have tuned to them. Runs are appended to the
table, one JSON document a line, and those that it holds are not repeated; the summary of all goes to stdout.
"""

import argparse
import json
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from drawn_sets import runs_of, seed_of_commit, share

from onboard.json_file import as_json

sys.path.insert(0, str(Path(__file__).parents[1]))

CALM = 0.25
"""Share of the sets without wind."""


def run(seed: int) -> dict[str, Any]:
    """One set: fly, find, compare."""
    from calibration.flights import open_flights
    from calibration.gap.find import GapQuestion, find_gap
    from tests.truth.tunnel import draw, make_flights, nominal

    rng = np.random.default_rng([seed, 3])
    speed = 0.0 if rng.random() < CALM else float(rng.uniform(3.0, 12.0))
    truth = draw(seed, speed)
    with tempfile.TemporaryDirectory() as folder:
        files = make_flights(truth, seed, int(rng.integers(4, 9)), Path(folder))
        found_gap = find_gap(open_flights(files)[0], GapQuestion(vehicle=nominal(truth), seed=seed))
        report = as_json(found_gap.report)
    named = {effect["name"]: effect for effect in report["effects"]}
    found = named.get("wind", {}).get("parameters", {})
    x, y = (found.get(axis, {}).get("value", 0.0) for axis in "xy")
    turned = math.degrees(math.atan2(y, x) - math.atan2(truth.wind_y, truth.wind_x))
    gap = report["gap"]
    drags = {"linear_drag", "rotor_drag", "body_drag"}
    return {
        "seed": seed,
        "law": "square" if truth.square else "linear",
        "wind": round(speed, 2),
        "flights": len(files),
        "verdict": report["verdict"],
        "named": list(named),
        "wind_named": "wind" in named,
        "direction_deg": round(abs((turned + 180.0) % 360.0 - 180.0), 1) if found and speed else None,
        "speed_ratio": round(math.hypot(x, y) / speed, 3) if found and speed else None,
        "ambiguous": named.get("wind", {}).get("ambiguous_with", []),
        "false_names": sorted(set(named) - drags - ({"wind"} if speed else set())),
        "before_m": round(gap["before"], 4),
        "after_m": round(gap["after"], 4),
    }


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Shares with Wilson's intervals of 95 %."""
    windy = [one for one in runs if one["wind"] > 0.0]
    right = [
        one["wind_named"] and one["direction_deg"] <= 10.0 and abs(one["speed_ratio"] - 1.0) <= 0.25
        for one in windy
    ]
    calm = [one for one in runs if one["wind"] == 0.0]
    return {
        "sets": len(runs),
        "wind_within_10_deg_and_25_percent": share(right),
        "closed_85_percent": share([one["after_m"] <= 0.15 * one["before_m"] for one in windy]),
        "worse": share([one["after_m"] > one["before_m"] for one in runs]),
        "false_names": share([bool(one["false_names"]) for one in runs]),
        "calm_drag_and_no_wind": share([not one["wind_named"] and bool(one["named"]) for one in calm]),
    }


def main() -> None:
    """Parse, run what the table lacks, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--first", type=int, help="first seed; default: from the commit")
    parser.add_argument("--table", type=Path, required=True)
    asked = parser.parse_args()
    first = seed_of_commit() if asked.first is None else asked.first
    runs = runs_of(asked.table, range(first, first + asked.runs), lambda one: one["seed"], run)
    print(json.dumps(summary(runs), indent=1))


if __name__ == "__main__":
    main()
