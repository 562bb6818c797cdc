"""Judge hidden pads by `gap landings --search`: names, values, false claims. One line of JSON each.

python -m tests.truth.landings.judge --seeds 8 --pads 3 --table FILE

The last line counts all that the table has; the next run goes on with it.

Every seed has its own landings, flown healthy, with the hinges alone changed, and with pads of drawn limits
besides; they share one table of predictions, since nothing differs before the first touch. With
``--mixed-healthy`` drones whose landings end in all ways are each judged with a vehicle file that says all
that they are: nothing is hidden, and much happens.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from calibration.flights import flight_files, open_flights
from calibration.gap.landings.outcomes import PreparedLandings, prepare, read_labels
from calibration.gap.landings.outcomes.document import classified
from calibration.gap.landings.outcomes.search import LAWS, OutcomeSearch, search_outcomes
from calibration.gap.landings.outcomes.tables import tabulate
from calibration.gap.landings.outcomes.vehicles import (
    EFFECT_OF,
    UNITS,
    WITHOUT,
    Point,
    bare_parameters,
    filed_point,
    grid,
)
from calibration.measurement import wilson_interval
from onboard.arrays import FloatArray
from onboard.outcome import Outcome
from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle, load_vehicle
from tests.truth.landings.drone import Drone
from tests.truth.landings.outcomes import write_outcomes

VEHICLE = "crazyflie21-upgraded-stored"
HEALTHY = Drone()
HINGES = Drone(stiffness=1.6 * HEALTHY.stiffness, damping=8.0 * HEALTHY.damping)


@dataclass(frozen=True)
class Judged:
    """What was hidden, how the landings ended, what our model of it predicts, and what the search said.

    `predicted`: probabilities (n, 3) of four legs, two, none; None where the hidden drone is not on the grid.
    `fewer`: what the search said of the first of these landings alone, by their number.
    """

    hidden: Drone
    counts: tuple[int, ...]
    predicted: FloatArray | None
    found: OutcomeSearch
    fewer: Mapping[int, OutcomeSearch]

    @property
    def named(self) -> tuple[str, ...]:
        return self.found.named

    @property
    def speed(self) -> tuple[float, float, float]:
        """Limit of the pads (m/s) and its 95 % interval, where it was named."""
        found = self.found.values["speed"]
        return found.mean, *found.ci95


def judge(
    hidden: Sequence[Drone],
    count: int,
    seed: int,
    draws: int,
    points: Sequence[Point] | None = None,
    filed: Sequence[Vehicle] | None = None,
    fewer: Sequence[int] = (),
) -> list[Judged]:
    """Fly `count` landings with each hidden drone, and search among `points` (default: all vehicles).

    All drones are judged with VEHICLE and have the same luck with their pads; with `filed` each is judged
    with a vehicle of its own, and its pads are drawn apart from those of the others. The first `fewer`
    landings are searched as if there were no more.
    """
    vehicles = [load_vehicle(VEHICLE)] * len(hidden) if filed is None else filed
    parameters = bare_parameters(vehicles[0])
    said = [filed_point(vehicle) for vehicle in vehicles]
    tried = [grid(parameters, one) if points is None else points for one in said]
    rows = {point: row for row, point in enumerate(dict.fromkeys(point for one in tried for point in one))}
    prepared: PreparedLandings | None = None
    table = np.empty(0)
    verdicts = []
    for index, drone in enumerate(hidden):
        with tempfile.TemporaryDirectory() as folder:
            where, answer = Path(folder) / "f", Path(folder) / "answer.json"
            write_outcomes(drone, count, seed, where, answer, pads=0 if filed is None else index)
            flights, _ = open_flights(flight_files([where]))
            labels = read_labels([flight.source for flight in flights])
        outcomes: Mapping[str, Outcome] = {flight.name: labels[flight.source] for flight in flights}
        if prepared is None:
            prepared = prepare(flights, vehicles[0], np.random.default_rng(seed), draws)
            table = tabulate(prepared, parameters, tuple(rows))
        known, real = classified([outcomes[start.name] for start in prepared.starts])
        own = table[[rows[point] for point in tried[index]]][:, known]
        found = {
            flown: search_outcomes(
                tried[index],
                own[:, :flown],
                real[:flown],
                draws,
                np.random.default_rng([seed, 1]),
                said[index],
            )
            for flown in (real.size, *fewer)
        }
        point = as_point(drone)
        predicted = table[rows[point], known] if point in rows else None
        counts = tuple(np.bincount(real, minlength=3).tolist())
        verdicts.append(Judged(drone, counts, predicted, found.pop(real.size), found))
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


def as_vehicle(drone: Drone) -> Vehicle:
    """VEHICLE with a file that says of legs, pads and hull what this drone is."""
    found: dict[str, dict[str, Quantity]] = {}
    for name, value in as_point(drone)._asdict().items():
        if value != getattr(WITHOUT, name):
            effect, parameter = EFFECT_OF[name]
            found.setdefault(effect, {})[parameter] = Quantity(value, UNITS[name], 0.0, "as hidden")
    stored = load_vehicle(VEHICLE)
    effects = tuple(Effect(name=name, parameters=parameters) for name, parameters in found.items())
    return replace(stored, effects=(*stored.effects, *effects))


def mixed(seed: int, count: int) -> list[Drone]:
    """Drones whose landings end in all ways, as the authors' do: hinges, and pads that refuse many feet."""
    rng = np.random.default_rng([seed, 10])
    limits = [(rng.uniform(0.5, 0.8), rng.uniform(0.2, 0.4)) for _ in range(count)]
    return [replace(HINGES, capture=v, capture_spread=s) for v, s in limits]


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
    """What the table has of a set; `filed` only where the vehicle file says any of it, `expected` only of a
    hidden drone that is a vehicle of the grid, `fewer` only where fewer landings were searched too."""
    hidden, filed = as_point(one.hidden), one.found.filed
    expected = {} if one.predicted is None else {"expected": _short(*one.predicted.sum(axis=0))}
    return {
        "seed": seed,
        "hidden": _said(hidden),
        **({} if filed == WITHOUT else {"filed": _said(filed)}),
        "four_two_none": one.counts,
        **expected,
        **_told(one.found),
        "gains": {group: _short(gain.brier, *gain.ci95) for group, gain in one.found.gains.items()},
        **({"fewer": {str(flown): _told(few) for flown, few in one.fewer.items()}} if one.fewer else {}),
    }


def _told(found: OutcomeSearch) -> dict[str, Any]:
    values = {name: _short(one.mean, *one.ci95) for name, one in found.values.items()}
    return {"named": found.named, "values": values}


def _said(point: Point) -> dict[str, Any]:
    return {"hinges": point.stiffness > 1.0, "speed": point.speed, "spread": point.spread}


def _short(*values: float) -> list[float]:
    return [round(value, 3) for value in values]


def lines_of(table: Path | None) -> list[dict[str, Any]]:
    """What a table has already; nothing where there is none."""
    if table is None or not table.exists():
        return []
    return [json.loads(text) for text in table.read_text(encoding="utf-8").splitlines()]


def summary(lines: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Of each kind of hidden drone: sets, in how many of them what was named, with 95 % by Wilson.

    What was said of the first landings of sets alone follows, as kinds of their own.
    """
    kinds: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for one in lines:
        kind = _kind(one)
        kinds.setdefault((kind, kind), []).append(one)
    for one in lines:
        for flown, few in one.get("fewer", {}).items():
            kind = _kind(one)
            kinds.setdefault((f"{kind}, first {flown}", kind), []).append({**one, **few})
    return {
        name: {
            "sets": len(sets),
            "named": {
                claim: _rate(sum(test(one) for one in sets), len(sets))
                for claim, test in _CLAIMS[kind].items()
            },
        }
        for (name, kind), sets in kinds.items()
    }


def _kind(one: Mapping[str, Any]) -> str:
    """What is hidden from the vehicle file, which says nothing of it where `filed` is not in the line."""
    hidden = one["hidden"]
    if "filed" in one:
        if one["filed"] != hidden:
            raise ValueError(f"seed {one['seed']}: a file that says something else than what was flown")
        return "mixed_healthy"
    return "pads" if hidden["speed"] > 0.0 else "hinges" if hidden["hinges"] else "nothing"


def _rate(count: int, sets: int) -> dict[str, Any]:
    return {"sets": count, "wilson95": wilson_interval(count, sets)}


def _inside(one: Mapping[str, Any]) -> bool:
    _, low, high = one["values"].get("speed", (0.0, 0.0, 0.0))
    return "pads" in one["named"] and bool(low <= one["hidden"]["speed"] <= high)


_CLAIMS: dict[str, dict[str, Callable[[Mapping[str, Any]], bool]]] = {
    "nothing": {"anything": lambda one: bool(one["named"])},
    "mixed_healthy": {"anything": lambda one: bool(one["named"])},
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
        "--mixed-healthy", action="store_true", help="hinges and pads, and a file that says so"
    )
    parser.add_argument("--fewer", type=int, nargs="*", default=[], help="search the first N of each, too")
    parser.add_argument(
        "--table", type=Path, help="lines go to this file too; seeds in it are not judged again"
    )
    chosen = parser.parse_args()
    known = lines_of(chosen.table)
    for seed in range(chosen.first, chosen.first + chosen.seeds):
        if seed in {one["seed"] for one in known}:
            continue
        filed = None
        if chosen.mixed_healthy:
            hidden = mixed(seed, chosen.pads)
            filed = [as_vehicle(drone) for drone in hidden]
        else:
            hidden = [HEALTHY] if chosen.healthy else drawn(seed, chosen.pads)
        judged = judge(hidden, chosen.count, seed, chosen.draws, filed=filed, fewer=chosen.fewer)
        made = [line(seed, one) for one in judged]
        known += made
        text = "".join(json.dumps(one) + "\n" for one in made)
        sys.stdout.write(text)
        if chosen.table is not None:
            with chosen.table.open("a", encoding="utf-8") as stream:  # a seed whole or not at all
                stream.write(text)
    sys.stdout.write(json.dumps({"in_all": summary(known)}) + "\n")


if __name__ == "__main__":
    main()
