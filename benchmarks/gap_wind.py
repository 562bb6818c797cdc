"""Judge the gap finder by kilogram-class vehicles in steady wind, drawn at random from another program.

    python benchmarks/gap_wind.py --runs 10 --table FILE [--first N]

Seeds follow from the commit of the finder, so that nobody can have tuned to them. Runs are appended to the
table, one JSON document a line, and those that it holds are not repeated; the summary of all goes to stdout.
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from onboard.json_file import as_json

sys.path.insert(0, str(Path(__file__).parents[1]))

CALM = 0.25
"""Share of the sets without wind."""


def seed_of_commit() -> int:
    """A number that the finder's last commit gives."""
    done = subprocess.run(
        ["git", "log", "-1", "--format=%H", "--", "calibration/gap"],
        capture_output=True, text=True, check=True, cwd=Path(__file__).parent.parent,
    )  # fmt: skip
    return int(done.stdout[:8], 16)


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
        "wind_within_10_deg_and_25_percent": _share(right),
        "closed_85_percent": _share([one["after_m"] <= 0.15 * one["before_m"] for one in windy]),
        "worse": _share([one["after_m"] > one["before_m"] for one in runs]),
        "false_names": _share([bool(one["false_names"]) for one in runs]),
        "calm_drag_and_no_wind": _share([not one["wind_named"] and bool(one["named"]) for one in calm]),
    }


def _share(values: list[bool]) -> str:
    count, z = len(values), 1.96
    if not count:
        return "none"
    p = sum(values) / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count))
    return f"{sum(values)} of {count} ({max(middle - half, 0.0):.2f} to {min(middle + half, 1.0):.2f})"


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
    runs = [json.loads(line) for line in asked.table.read_text().splitlines()] if asked.table.exists() else []
    for seed in range(first, first + asked.runs):
        if seed not in {one["seed"] for one in runs}:
            runs.append(run(seed))
            with asked.table.open("a") as table:
                table.write(json.dumps(runs[-1]) + "\n")
            print(json.dumps(runs[-1]), file=sys.stderr, flush=True)
    print(json.dumps(summary(runs), indent=1))


if __name__ == "__main__":
    main()
