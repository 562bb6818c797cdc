"""Judge the gap finder on real flights: shapes that no fit saw, and whether two halves say the same.

    python benchmarks/real_flights.py --data FOLDER [--vehicle V] [--jobs 2] [--splits even odd] [--again]

For every shape of trajectory all flights of other shapes are given to ``find_gap``; the improved vehicle then
predicts the flights of that shape with measured attitude, thrust scale and trim of each flight fitted to its
first 8 s (groups of airframes differ). Then every second flight, and the others. One JSON document goes to
stdout: effects with values, errors after 1 s before and after, the floor of the accelerometer, attitude after
0.1 s without such a calibration (with the disturbance torque of the last 0.2 s), and how many of the flights
our own attitude law flies again with the model. With `--again` the flights that were fitted are given to
``find_gap`` once more with the vehicle that it wrote: what it still names, and how it predicts then.
"""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

HORIZON, CALIBRATED, SHORT = 1.0, 8.0, 0.1
"""s."""

LOST = 45.0
"""deg between measured and needed attitude: a flight that the law has lost."""


def run(folder: Path, vehicle: str, split: str, fitted: Sequence[str], again: bool) -> dict[str, Any]:
    """Find on the flights named in `fitted`, predict the others; find `again` with what was written."""
    from calibration.flights import open_flights
    from calibration.gap.data import prepare_flights
    from calibration.gap.find import GapQuestion, find_gap
    from calibration.gap.replay import evaluate
    from calibration.gap.sensors import apply_sensing, judge_sensing
    from onboard.vehicle import load_vehicle

    flights = open_flights(_files(folder))[0]
    everything = prepare_flights(flights).records
    some = [flight for flight in flights if flight.source.name.split(".")[0] in fitted]
    found = find_gap(some, GapQuestion(vehicle=load_vehicle(vehicle)))
    unseen = [r for r in apply_sensing(everything, judge_sensing(everything)) if r.name not in fitted]
    models = {"before": load_vehicle(vehicle), "after": _in_flight(found.vehicle)}
    second = find_gap(some, GapQuestion(vehicle=found.vehicle)) if again else None
    if second is not None:
        models["again"] = _in_flight(second.vehicle)
    return {
        "split": split,
        "fitted": len(some),
        "unseen": [record.name for record in unseen],
        "verdict": found.report.verdict,
        "effects": _effects(found.report),
        "effects_again": None if second is None else _effects(second.report),
        "verdict_again": None if second is None else second.report.verdict,
        "ambiguous": [list(one.names) for one in found.report.ambiguous],
        "rejected": [f"{one.name}: {one.reason}" for one in found.report.rejected],
        "unexplained": found.report.unexplained.formula,
        "errors": {
            name: _after(evaluate(unseen, model, (HORIZON,), CALIBRATED)) for name, model in models.items()
        },
        "attitude_deg": {
            name: round(evaluate(unseen, model, (SHORT,)).with_torque_estimate[SHORT].attitude_deg, 2)
            for name, model in models.items()
        },
        "flown_again": {name: _flown_again(unseen, model) for name, model in models.items()},
    }


def _effects(report: Any) -> dict[str, Any]:
    return {
        effect.name: {
            key: {"value": one.value, "ci95": list(one.ci95), "unit": one.unit}
            for key, one in effect.parameters.items()
        }
        for effect in report.effects
    }


def _in_flight(vehicle: Any) -> Any:
    """The vehicle without what was taken out of the measurements already."""
    import dataclasses

    from onboard.vehicle import EFFECTS
    from onboard.vehicle.effects import Domain

    kept = tuple(e for e in vehicle.effects if EFFECTS[e.name].domain is not Domain.SENSING)
    return dataclasses.replace(vehicle, effects=tuple(e for e in kept if e.name != "pose_delay"))


def _after(errors: Any) -> dict[str, float]:
    model, floor = (one.given_attitude[HORIZON] for one in (errors.overall, errors.floor))
    return {
        "position_m": round(model.position_m, 4),
        "velocity_m_s": round(model.velocity_m_s, 4),
        "floor_position_m": round(floor.position_m, 4),
        "floor_velocity_m_s": round(floor.velocity_m_s, 4),
    }


def _flown_again(records: Sequence[Any], vehicle: Any) -> str:
    """How many flights our law flies along their measured path with the model, of those long enough.

    Each has its own thrust scale and trim, of its first seconds, as its predictions have.
    """
    from calibration.gap.replay import evaluate, fly_again

    own = {f.record.name: f.nuisances for f in evaluate(records, vehicle, (HORIZON,), CALIBRATED).flights}
    again = (fly_again(record, vehicle, own.get(record.name)) for record in records)
    flights = [flight for flight in again if flight is not None]
    turned = [np.abs(np.sum(one.attitude * one.needed_attitude, axis=1)) for one in flights]
    kept = [2.0 * np.degrees(np.arccos(np.minimum(cosines, 1.0))).max() < LOST for cosines in turned]
    return f"{sum(kept)} of {len(kept)}"


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.name.endswith((".csv", ".csv.gz")))


def splits(folder: Path) -> dict[str, list[str]]:
    """Names of the flights to fit to, by split."""
    from calibration.flights import open_flights
    from calibration.gap.data import prepare_flights

    records = prepare_flights(open_flights(_files(folder))[0]).records
    shapes = {record.name: "_".join(record.name.split("_")[:2]) for record in records}  # B5_helix_fast_rep1
    named = {
        f"without {shape}": [name for name, own in shapes.items() if own != shape]
        for shape in sorted(set(shapes.values()))
    }
    named["even"], named["odd"] = ([record.name for record in records[first::2]] for first in (0, 1))
    return named


def main() -> None:
    """Parse, run in processes of their own, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--vehicle", default="crazyflie21-stock")
    parser.add_argument("--splits", nargs="*", help="only these")
    parser.add_argument(
        "--again", action="store_true", help="find once more with the vehicle that was written"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    asked = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    wanted = splits(asked.data)
    if unknown := set(asked.splits or ()) - set(wanted):
        parser.error(f"no split {', '.join(sorted(unknown))}; there are: {', '.join(wanted)}")
    wanted = {k: v for k, v in wanted.items() if not asked.splits or k in asked.splits}
    runs = []
    with ProcessPoolExecutor(asked.jobs) as pool:
        futures = [pool.submit(run, asked.data, asked.vehicle, *one, asked.again) for one in wanted.items()]
        for number, future in enumerate(futures, 1):
            runs.append(future.result())
            print(f"{number}/{len(wanted)} {json.dumps(runs[-1])}", file=sys.stderr, flush=True)
    shapes = [r for r in runs if r["split"].startswith("without")]
    weights = [len(r["unseen"]) for r in shapes]
    overall = {
        key: round(float(np.average([r["errors"]["after"][key] for r in shapes], weights=weights)), 4)
        for key in (shapes[0]["errors"]["after"] if shapes else ())
    }
    print(json.dumps({"benchmark": "real_flights", "unseen_shapes": overall, "runs": runs}, indent=1))


if __name__ == "__main__":
    main()
