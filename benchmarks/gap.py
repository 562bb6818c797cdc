"""Judge the gap finder by effects that another program hid: names, values, intervals, false claims.

    python benchmarks/gap.py [--cases NAME ...] [--sizes weak medium strong] [--seeds 1 2 ...] [--jobs 2]

Flights come from ``tests/gap/truth``, which shares no equation with the finder and seals the answer in a file
of its own. Every run is ``find_gap`` as a user calls it, on flights read from files. One JSON document goes
to stdout: each run, the confusion matrix of truths against first names, and the figures of docs/gap.md.
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

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

VEHICLE = "crazyflie21-stock"
SINGLE = (
    "thrust_scale", "mass_error", "battery_sag", "motor_lag", "motor_lag_asymmetry", "command_delay",
    "rotor_drag", "velocity_moment", "inertia_error", "com_offset", "motor_imbalance", "motor_saturation",
    "thrust_curve", "ceiling_effect", "ground_effect", "pose_delay", "pose_rotation", "tether",
)  # fmt: skip
OTHERS = ("none", "two", "three", "unlisted_force_region", "unlisted_torque_line")
SMALL = 0.2
"""Parameters smaller than this share of an effect's largest are left out of relative errors."""


def run(case: str, size: str, seed: int, flights: int) -> dict[str, Any]:
    """Hide, find, compare."""
    from calibration.flights import open_flights
    from calibration.gap.find import Question, find_gap
    from calibration.gap.prepare import prepare_flights
    from onboard.vehicle import load_vehicle
    from tests.gap.truth.campaign import make_flights

    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        files = make_flights(case, size, seed, flights, out=Path(folder) / "flights", answer=answer)
        started = time.monotonic()
        read = open_flights(files)[0]
        asked = Question(vehicle=load_vehicle(VEHICLE), seed=seed)
        report = find_gap(read, prepare_flights(read), asked).report.to_json()
        seconds = time.monotonic() - started
        sealed = json.loads(answer.read_text())
    return {"case": case, "size": size, "seed": seed, "seconds": round(seconds, 1), **judge(report, sealed)}


def judge(report: dict[str, Any], sealed: dict[str, Any]) -> dict[str, Any]:
    """A report against the sealed answer."""
    truth = {effect["name"]: effect for effect in sealed["effects"]}
    named = {effect["name"]: effect for effect in report["effects"]}
    first = next(iter(report["effects"]), None)
    same = {effect["name"]: _same(effect, truth) for effect in report["effects"]}
    pairs = [pair for name in named if name in truth for pair in _values(named[name], truth[name])]
    return {
        "truth": list(truth),
        "named": list(named),
        "first": first["name"] if first else None,
        "ambiguous": {name: effect["ambiguous_with"] for name, effect in named.items()},
        "verdict": report["verdict"],
        "expected_verdict": sealed["verdict"],
        "first_right": bool(first) and same[first["name"]],
        "all_found": all(
            name in named or any(name in effect["ambiguous_with"] for effect in named.values())
            for name in truth
        ),
        "false_names": [name for name, right in same.items() if not right],
        "relative_errors": [pair["error"] for pair in pairs],
        "covered": [pair["covered"] for pair in pairs],
        "closed_share": _closed(report, first),
        "unexplained": report["unexplained"],
        "unlisted": sealed.get("unlisted"),
    }


def _same(effect: dict[str, Any], truth: dict[str, Any]) -> bool:
    """Whether a name is the truth, or says that it may be."""
    return effect["name"] in truth or any(name in truth for name in effect["ambiguous_with"])


def _values(found: dict[str, Any], hidden: dict[str, Any]) -> list[dict[str, Any]]:
    from onboard.vehicle import EFFECTS

    if found["name"] == "ceiling_effect":
        return [_ceiling_gain(found, hidden)]
    rules = EFFECTS[found["name"]].parameters
    size = {k: abs(v - (rules[k].neutral or 0.0)) for k, v in hidden["parameters"].items()}
    pairs = []
    for key, value in hidden["parameters"].items():
        if key in found["parameters"] and size[key] >= SMALL * max(size.values()) and size[key] > 0.0:
            one = found["parameters"][key]
            covered = one["ci95"][0] <= value <= one["ci95"][1]
            pairs.append({"error": abs(one["value"] - value) / size[key], "covered": covered})
    return pairs


def _ceiling_gain(found: dict[str, Any], hidden: dict[str, Any]) -> dict[str, Any]:
    """Its two parameters trade off: what counts is the gain of thrust, here 50 mm below the ceiling."""
    from sim_backend.physics.effects.ceiling_effect import EFFECT, ceiling_gain
    from sim_backend.physics.parameters import PARAMETERS

    gains = []
    values = {key: one["value"] for key, one in found["parameters"].items()}
    for parameters in ({"inflow": 0.0, "opening": 1.0, **values}, hidden["parameters"]):
        p = np.zeros(1, dtype=PARAMETERS)[0]
        p["propeller_radius"] = 0.0225
        EFFECT.apply(p, parameters)
        gains.append(ceiling_gain(p, 0.05, 1.0) - 1.0)
    return {"error": abs(gains[0] / gains[1] - 1.0), "covered": None}


def _closed(report: dict[str, Any], first: dict[str, Any] | None) -> float | None:
    if first is None or not first["error_before"] > 0.0:
        return None
    return 1.0 - first["error_after"] / first["error_before"]


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
        errors = [e for r in single for e in r["relative_errors"]]
        unlisted = [r for r in runs if r["size"] == size and r["case"].startswith("unlisted")]
        figures[size] = {
            "single_runs": len(single),
            "right_name_first": share([r["first_right"] for r in single]),
            "misnamed": share([bool(r["false_names"]) for r in single]),
            "relative_error_median": quantile(errors, 0.5),
            "relative_error_p90": quantile(errors, 0.9),
            "intervals_cover": share([c for r in single for c in r["covered"] if c is not None]),
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
