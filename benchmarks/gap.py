"""Judge the gap finder by effects that another program hid: names, values, intervals, false claims.

    python benchmarks/gap.py [--cases NAME ...] [--sizes weak medium strong] [--seeds 1 2 ...] [--jobs 2]

Flights come from ``tests/truth/hidden_effects``, which shares no equation with the finder and seals the
answer in a file of its own. Every run is ``find_gap`` as a user calls it, on flights read from files. One
JSON document goes to stdout: each run, the confusion matrix of truths against first names, and figures of
docs/gap_figures.md.
"""

import argparse
import json
import math
import os
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

from gap_judgement import closed_share, judge

from onboard.json_file import as_json

sys.path.insert(0, str(Path(__file__).parents[1]))

VEHICLE = "crazyflie21-stock"
SINGLE = (
    "thrust_scale", "mass_error", "battery_sag", "motor_warming", "motor_lag", "motor_lag_asymmetry",
    "command_delay", "rotor_drag", "body_drag", "inflow_thrust_loss", "translational_lift",
    "velocity_moment", "rate_damping", "rotor_gyroscopic", "rotor_acceleration_torque", "inertia_error",
    "com_offset", "motor_imbalance", "motor_saturation", "thrust_curve", "ceiling_effect", "ground_effect",
    "thrust_tilt", "pose_delay", "pose_rotation", "pose_offset", "gyro_bias", "tether",
)  # fmt: skip
OTHERS = ("none", "two", "three", "unlisted_force_region", "unlisted_torque_line")
CEILING = 2.1
"""m, of the hidden room."""


def run(case: str, size: str, seed: int, flights: int) -> dict[str, Any]:
    """Hide, find, compare."""
    from calibration.flights import open_flights
    from calibration.gap.data import prepare_flights
    from calibration.gap.find import GapQuestion, find_gap
    from onboard.vehicle import load_vehicle
    from tests.truth.hidden_effects.campaign import make_flights

    vehicle = load_vehicle(VEHICLE)
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        files = make_flights(case, size, seed, flights, out=Path(folder) / "flights", answer=answer)
        started = time.monotonic()
        read = open_flights(files)[0]
        found = find_gap(read, GapQuestion(vehicle=vehicle, seed=seed))
        seconds = time.monotonic() - started
        records = prepare_flights(read).records
        sealed = json.loads(answer.read_text())
    report = as_json(found.report)
    return {
        "case": case,
        "size": size,
        "seed": seed,
        "seconds": round(seconds, 1),
        **judge(report, sealed),
        "closed": closed_share(records, report["flights"]["held_out"], found, vehicle, sealed, CEILING),
    }


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures that the acceptance lines ask for, by size; None where no run says anything."""

    def share(values: list[bool]) -> float | None:
        return round(sum(values) / len(values), 3) if values else None

    def quantile(values: list[float], at: float) -> float | None:
        return (
            round(sorted(values)[min(len(values) - 1, math.floor(at * len(values)))], 4) if values else None
        )

    figures: dict[str, Any] = {}
    for size in dict.fromkeys(r["size"] for r in runs):
        single = [r for r in runs if r["size"] == size and r["case"] in SINGLE]
        values = [pair for r in single for pair in r["values"]]
        errors = [pair["error"] for pair in values]
        unlisted = [r for r in runs if r["size"] == size and r["case"].startswith("unlisted")]
        figures[size] = {
            "single_runs": len(single),
            "right_name_first": share([r["first_right"] for r in single]),
            "misnamed": share([bool(r["false_names"]) for r in single]),
            "gap_closed_median": quantile([r["closed"] for r in single if r["closed"] is not None], 0.5),
            "gap_closed_p10": quantile([r["closed"] for r in single if r["closed"] is not None], 0.1),
            "relative_error_median": quantile(errors, 0.5),
            "relative_error_p90": quantile(errors, 0.9),
            "within_10_percent": share([e <= 0.1 for e in errors]),
            "within_5_percent": share([e <= 0.05 for e in errors]),
            "intervals_cover": share([v["covered"] for v in values if v["covered"] is not None]),
            "unlisted_called_unexplained": share([r["verdict"] == "unexplained_gap" for r in unlisted]),
        }
        for case in ("two", "three"):
            several = [r for r in runs if r["size"] == size and r["case"] == case]
            figures[size][case] = {
                "runs": len(several),
                "all_found": share([r["all_found"] for r in several]),
                "no_other_name": share([not r["false_names"] for r in several]),
            }
    nothing = [r for r in runs if r["case"] == "none"]
    figures["none"] = {
        "runs": len(nothing),
        "false_claims": share([r["verdict"] != "no_gap" for r in nothing]),
    }
    figures["seconds_median"] = quantile([r["seconds"] for r in runs], 0.5)
    return figures


def main() -> None:
    """Parse, run in processes of their own, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", nargs="+", default=[*SINGLE, *OTHERS])
    parser.add_argument("--sizes", nargs="+", default=["medium"], choices=["weak", "medium", "strong"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--flights", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    runs = []
    with ProcessPoolExecutor(asked.jobs) as pool:
        wanted = list(product(asked.cases, asked.sizes, asked.seeds))
        futures = [pool.submit(run, *one, asked.flights) for one in wanted]
        for number, future in enumerate(futures, 1):
            runs.append(future.result())
            print(f"{number}/{len(wanted)} {json.dumps(runs[-1])}", file=sys.stderr, flush=True)
    matrix = Counter((r["case"], r["first"] or "nothing") for r in runs)
    document = {
        "benchmark": "gap",
        "vehicle": VEHICLE,
        "seeds": asked.seeds,
        "figures": summary(runs),
        "confusion": [{"truth": t, "first": f, "runs": n} for (t, f), n in sorted(matrix.items())],
        "runs": runs,
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
