"""Judge hidden pads by `gap landings --search`: names, values, false claims. One line of JSON each.

python -m tests.truth.landings.judge --seeds 8 --pads 3 --table FILE

The last line counts all that the table has; the next run goes on with it.

Every seed has its own landings, flown healthy, with the hinges alone changed, and with pads of drawn limits
besides; they share one table of predictions, since nothing differs before the first touch.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calibration.flights import flight_files, open_flights
from calibration.gap.landings.outcomes import PreparedLandings, prepare, read_labels
from calibration.gap.landings.outcomes.document import classified
from calibration.gap.landings.outcomes.search import LAWS, OutcomeSearch, search_outcomes
from calibration.gap.landings.outcomes.tables import tabulate
from calibration.gap.landings.outcomes.vehicles import Point, bare_parameters, grid
from calibration.measurement import wilson_interval
from onboard.arrays import FloatArray
from onboard.outcome import Outcome
from onboard.vehicle import load_vehicle
from tests.truth.landings.drone import Drone
from tests.truth.landings.outcomes import write_outcomes

VEHICLE = "crazyflie21-upgraded-stored"
HEALTHY = Drone()
HINGES = Drone(stiffness=1.6 * HEALTHY.stiffness, damping=8.0 * HEALTHY.damping)


@dataclass(frozen=True)
class Judged:
    """What was hidden, how the landings ended, what our model of it predicts, and what the search said.

    `predicted`: probabilities (n, 3) of four legs, two, none; None where the hidden drone is not on the grid.
    """

    hidden: Drone
    counts: tuple[int, ...]
    predicted: FloatArray | None
    found: OutcomeSearch

    @property
    def named(self) -> tuple[str, ...]:
        return self.found.named

    @property
    def speed(self) -> tuple[float, float, float]:
        """Limit of the pads (m/s) and its 95 % interval, where it was named."""
        found = self.found.values["speed"]
        return found.mean, *found.ci95


def judge(
    hidden: Sequence[Drone], count: int, seed: int, draws: int, points: Sequence[Point] | None = None
) -> list[Judged]:
    """Fly `count` landings with each hidden drone, and search among `points` (default: all vehicles)."""
    parameters = bare_parameters(load_vehicle(VEHICLE))
    points = grid(parameters) if points is None else points
    prepared: PreparedLandings | None = None
    table = np.empty(0)
    verdicts = []
    for drone in hidden:
        with tempfile.TemporaryDirectory() as folder:
            write_outcomes(drone, count, seed, Path(folder) / "f", Path(folder) / "answer.json")
            flights, _ = open_flights(flight_files([Path(folder) / "f"]))
            labels = read_labels([flight.source for flight in flights])
        outcomes: Mapping[str, Outcome] = {flight.name: labels[flight.source] for flight in flights}
        if prepared is None:
            prepared = prepare(flights, load_vehicle(VEHICLE), np.random.default_rng(seed), draws)
            table = tabulate(prepared, parameters, points)
        rows, real = classified([outcomes[start.name] for start in prepared.starts])
        found = search_outcomes(points, table[:, rows], real, draws, np.random.default_rng([seed, 1]))
        own = as_point(drone)
        predicted = table[points.index(own), rows] if own in points else None
        counts = tuple(np.bincount(real, minlength=3).tolist())
        verdicts.append(Judged(drone, counts, predicted, found))
    return verdicts


def as_point(drone: Drone) -> Point:
    """The vehicle of the grid that is this drone."""
    return Point(
        stiffness=round(drone.stiffness / HEALTHY.stiffness, 9),
        damping=round(drone.damping / HEALTHY.damping, 9),
        speed=drone.capture,
        spread=drone.capture_spread,
        side_stiffness=drone.side_stiffness,
        side_damping=drone.side_damping,
        width=round(drone.box_half - HEALTHY.box_half, 9),
        top=round(drone.box_top - HEALTHY.box_top, 9),
        bottom=round(HEALTHY.box_bottom - drone.box_bottom, 9),
    )


def drawn(seed: int, pads: int) -> list[Drone]:
    """Nothing hidden, hinges alone, and `pads` drones with limits of 0.4 to 1.1 m/s."""
    rng = np.random.default_rng([seed, 9])
    limits = [(rng.uniform(0.4, 1.1), rng.uniform(0.15, 0.45)) for _ in range(pads)]
    stiffness, damping = HINGES.stiffness, HINGES.damping
    return [
        HEALTHY,
        HINGES,
        *(Drone(stiffness=stiffness, damping=damping, capture=v, capture_spread=s) for v, s in limits),
    ]


def line(seed: int, one: Judged) -> dict[str, Any]:
    values = {name: _short(found.mean, *found.ci95) for name, found in one.found.values.items()}
    return {
        "seed": seed,
        "hidden": {
            "hinges": one.hidden.stiffness > HEALTHY.stiffness,
            "speed": one.hidden.capture,
            "spread": one.hidden.capture_spread,
        },
        "four_two_none": one.counts,
        "named": one.named,
        "values": values,
        "gains": {group: _short(gain.brier, *gain.ci95) for group, gain in one.found.gains.items()},
    }


def _short(*values: float) -> list[float]:
    return [round(value, 3) for value in values]


def lines_of(table: Path | None) -> list[dict[str, Any]]:
    """What a table has already; nothing where there is none."""
    if table is None or not table.exists():
        return []
    return [json.loads(text) for text in table.read_text(encoding="utf-8").splitlines()]


def summary(lines: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Of each kind of hidden drone: sets, in how many of them what was named, with 95 % by Wilson."""
    kinds: dict[str, list[Mapping[str, Any]]] = {}
    for one in lines:
        hidden = one["hidden"]
        kind = "pads" if hidden["speed"] > 0.0 else "hinges" if hidden["hinges"] else "nothing"
        kinds.setdefault(kind, []).append(one)
    return {
        kind: {
            "sets": len(sets),
            "named": {
                name: _rate(sum(test(one) for one in sets), len(sets)) for name, test in _CLAIMS[kind].items()
            },
        }
        for kind, sets in kinds.items()
    }


def _rate(count: int, sets: int) -> dict[str, Any]:
    return {"sets": count, "wilson95": wilson_interval(count, sets)}


def _inside(one: Mapping[str, Any]) -> bool:
    _, low, high = one["values"].get("speed", (0.0, 0.0, 0.0))
    return "pads" in one["named"] and bool(low <= one["hidden"]["speed"] <= high)


_CLAIMS: dict[str, dict[str, Callable[[Mapping[str, Any]], bool]]] = {
    "nothing": {"anything": lambda one: bool(one["named"])},
    "hinges": {
        "hinges": lambda one: "hinges" in one["named"],
        "anything else": lambda one: bool(set(one["named"]) - {"hinges"}),
    },
    "pads": {
        "pads": lambda one: "pads" in one["named"],
        "pads, limit inside the interval": _inside,
        "another law": lambda one: bool(set(one["named"]) & set(LAWS) - {"pads"}),
        "axes, hull": lambda one: bool(set(one["named"]) & {"axes", "hull"}),
    },
}
"""What is counted, by what was hidden."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--pads", type=int, default=3)
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--healthy", action="store_true", help="nothing hidden, and nothing else")
    parser.add_argument(
        "--table", type=Path, help="lines go to this file too; seeds in it are not judged again"
    )
    chosen = parser.parse_args()
    known = lines_of(chosen.table)
    for seed in range(chosen.first, chosen.first + chosen.seeds):
        if seed in {one["seed"] for one in known}:
            continue
        hidden = [HEALTHY] if chosen.healthy else drawn(seed, chosen.pads)
        made = [line(seed, one) for one in judge(hidden, chosen.count, seed, chosen.draws)]
        known += made
        text = "".join(json.dumps(one) + "\n" for one in made)
        sys.stdout.write(text)
        if chosen.table is not None:
            with chosen.table.open("a", encoding="utf-8") as stream:  # a seed whole or not at all
                stream.write(text)
    sys.stdout.write(json.dumps({"in_all": summary(known)}) + "\n")


if __name__ == "__main__":
    main()
