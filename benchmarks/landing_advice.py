"""What would raise the real landing rate most, under the measured scatter. Prints one JSON document.

    python benchmarks/landing_advice.py --data ../shared/data [--rollouts 100] [--attempts 40000]

Rates of the policies over the same 117 conditions, with what to expect of real flights. Then one thing at a
time is changed for each of `--policies`, flown as it is: how often any four legs hold and how often cleanly,
over all conditions and in the band where most attempts hold. Where the world itself changes, the same for a
policy that is learned in it anew (from `--attempts` at random, as `perchhw learn surface` does; 0: none); its
gain is over one that is learned as briefly in the unchanged world. Standard errors are paired over the
conditions.
"""

import argparse
import dataclasses
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from onboard.arrays import FloatArray
from onboard.policy.files import Policy, find_policy, import_authors_policy, load_policy
from onboard.vehicle import known_leg_designs, load_vehicle, vehicle_to_toml
from perchhw.attempt import DEFAULT_VEHICLE
from perchhw.learning.bands import BANDS_DEG, FAST
from perchhw.learning.grid import Condition, conditions
from perchhw.learning.judged_range import inside_judged_range
from perchhw.learning.landing_surface import surface_pairs
from perchhw.learning.random_attempts import fly_at_random
from perchhw.learning.real_rate import AUTHORS_ERROR, real_rate
from perchhw.learning.refine import RefinementSettings, with_constant_moment
from perchhw.learning.setup import MEASURED, SENSING, LearningSetup
from perchhw.learning.sweep_folder import Row
from perchhw.learning.train import train_policy
from perchhw.learning.validate import validate_policy

SPEEDS, ANGLES_DEG = np.arange(1.5, 3.51, 0.25), np.arange(30.0, 91.0, 5.0)
GRID = conditions(SPEEDS, ANGLES_DEG)
MEASURED_WORLD = LearningSetup(sensing=MEASURED, domain="none", seed=7)
SHIPPED = ("default", "pads", "measured")
BEST_BAND = 30.0, 45.0, True
"""deg and whether fast: the approaches of which most hold."""

SHIFTS_MS = (-20, -10, 10, 20)
MOMENT_FACTORS = (0.8, 0.9, 1.1, 1.2)


COLUMNS = ("four_leg_rate", "landing_rate")
"""Any four legs, and clean ones: without contact of body or propellers."""


Change = tuple[str, str, dict[str, Any]]
"""Kind, words, and what was found."""


class Rates(NamedTuple):
    """Rates of :data:`COLUMNS` at each condition."""

    four: FloatArray
    clean: FloatArray


def with_sensing(name: str, **changes: Any) -> LearningSetup:
    """The measured world with other errors of the cues, under a name of their own."""
    SENSING[name] = SENSING[MEASURED]._replace(**changes)
    return dataclasses.replace(MEASURED_WORLD, sensing=name)


def worlds(folder: Path) -> Iterator[tuple[str, str, LearningSetup]]:
    """What can be changed about the world: kind, words, setup. `folder` keeps vehicle files."""
    measured = SENSING[MEASURED].launch
    ceiling = measured._replace(ceiling=0.0, ceiling_spread=0.01)
    speed = {"reached_x": 1.0, "reached_z": 1.0, "spread_x": 0.0, "spread_y": 0.0, "spread_z": 0.0}
    for design in known_leg_designs():
        yield "legs", design, dataclasses.replace(MEASURED_WORLD, legs=design)
    yield "scatter", "ceiling known to 10 mm", with_sensing("ceiling", launch=ceiling)
    yield "scatter", "speed reached as told", with_sensing("speed", launch=measured._replace(**speed))
    yield "scatter", "velocity of the cues to 0.02 m/s", with_sensing("velocity", velocity_bias=0.02)
    fixed = measured._replace(ceiling_spread=0.01)
    yield "scatter", "ceiling 29 mm off, to 10 mm", with_sensing("fixed ceiling", launch=fixed)
    all_three = ceiling._replace(**speed)
    yield "scatter", "all three", with_sensing("all three", launch=all_three, velocity_bias=0.02)
    yield "timing", "cues of no age", with_sensing("no age", cue_delay_max=0.0)
    yield "timing", "cues 10 ms older", with_sensing("older", cue_delay_min=0.01, cue_delay_max=0.025)
    vehicle = load_vehicle(DEFAULT_VEHICLE)
    pads = next(effect for effect in vehicle.effects if effect.name == "pad_capture")
    limit = pads.parameters["speed"]
    halved = {**pads.parameters, "speed": dataclasses.replace(limit, value=0.5 * limit.value)}
    softer = vehicle.with_effects([dataclasses.replace(pads, parameters=halved)])
    path = folder / "half.toml"
    path.write_text(vehicle_to_toml(softer), encoding="utf-8")
    yield "pads", "limit half as high", dataclasses.replace(MEASURED_WORLD, vehicle=str(path))


def earlier(policy: Policy, seconds: float) -> Policy:
    """The policy with its trigger region at a tau that is longer by `seconds`; moments as they were."""
    moved = policy.scaler_mean + np.array([seconds, 0.0, 0.0], np.float32)
    later = np.float32(seconds)
    return dataclasses.replace(
        policy, scaler_mean=moved, tau_min=policy.tau_min + later, tau_max=policy.tau_max + later
    )


def stronger(policy: Policy, factor: float) -> Policy:
    """The policy with its moments times `factor`, as far as the vehicle can give them."""
    last = policy.layers[-1]
    scaled = type(last)(np.float32(factor) * last.weights, np.float32(factor) * last.bias)
    return dataclasses.replace(policy, layers=(*policy.layers[:-1], scaled))


def learned(setup: LearningSetup, attempts: int) -> Policy:
    """A policy that is learned in a world from attempts at random."""
    taught = dataclasses.replace(setup, domain="paper", seed=1)
    speeds, angles = ((float(of[0]), float(of[-1])) for of in (SPEEDS, ANGLES_DEG))
    outs = fly_at_random(taught, speeds, angles, attempts)
    return train_policy(surface_pairs(outs, seed=1).pairs, seed=1).policy


def flown(policy: Policy, setup: LearningSetup, rollouts: int) -> tuple[Row, ...]:
    """Rows of the validation over all conditions."""
    return validate_policy(policy, setup, GRID, rollouts=rollouts)


def rates_of(rows: tuple[Row, ...]) -> Rates:
    """Both rates at each condition."""
    return Rates(*(np.array([float(row[name] or 0.0) for row in rows]) for name in COLUMNS))


def compared(rates: Rates, base: Rates) -> dict[str, Any]:
    """Mean rates, their gains over a base with standard errors, and the rates in the best band."""
    found: dict[str, Any] = {}
    inside = [inside_band(one, *BEST_BAND) for one in GRID]
    for name, now, before in zip(COLUMNS, rates, base, strict=True):
        difference = now - before
        error = difference.std(ddof=1) / np.sqrt(len(difference))
        found[name] = {
            "rate": float(now.mean()),
            "gain": float(difference.mean()),
            "error": float(error),
            "in_best_band": float(now[inside].mean()),
        }
    return found


def in_band(base: Rates, low: float, high: float, fast: bool) -> dict[str, Any]:
    """Mean rates of one band; their gains are over all conditions, unpaired."""
    inside = [inside_band(one, low, high, fast) for one in GRID]
    found: dict[str, Any] = {}
    for name, of_all in zip(COLUMNS, base, strict=True):
        rates = of_all[inside]
        error = np.hypot(*(of.std(ddof=1) / len(of) ** 0.5 for of in (rates, of_all)))
        mean = float(rates.mean())
        found[name] = {"rate": mean, "gain": mean - float(of_all.mean()), "error": float(error)}
    return found


def of_policies(data: Path, rollouts: int) -> dict[str, Any]:
    """Each policy under the measured scatter, and what to expect of its real flights."""
    flown_by = {
        "authors": import_authors_policy(data / "habas2022" / "policy" / "flown_policy.json", "flown")
    }
    flown_by |= {name: load_policy(find_policy(name)) for name in SHIPPED}
    found = {}
    for name, policy in flown_by.items():
        rows = flown(policy, MEASURED_WORLD, rollouts)
        expected = real_rate(rows, AUTHORS_ERROR, MEASURED_WORLD.seed)
        means = {
            column: float(np.mean([float(row[column] or 0.0) for row in rows]))
            for column in (*COLUMNS, "two_leg_rate", "trigger_rate")
        }
        found[name] = {**means, "real": expected.four_leg_rate, "real_ci95": expected.ci95}
    return found


def of_the_policy(policy: Policy, base: Rates, rollouts: int) -> Iterator[Change]:
    """What another trigger, moment or approach would change, in the same world."""
    for shift in SHIFTS_MS:
        rates = rates_of(flown(earlier(policy, 1e-3 * shift), MEASURED_WORLD, rollouts))
        yield "timing", f"trigger {shift:+d} ms of tau", compared(rates, base)
    for factor in MOMENT_FACTORS:
        rates = rates_of(flown(stronger(policy, factor), MEASURED_WORLD, rollouts))
        yield "action", f"moment x {factor:g}", compared(rates, base)
    yield "action", "best constant moment of each condition", compared(best_moments(policy, rollouts), base)
    for low, high in BANDS_DEG:
        for fast in (False, True):
            what = f"{low:g}-{min(high, 90.0):g} deg, {'from' if fast else 'below'} {FAST:g} m/s"
            yield "approach", what, in_band(base, low, high, fast)


def best_moments(policy: Policy, rollouts: int) -> Rates:
    """Rates with the constant moment at each condition that had most four legs, judged on other attempts."""
    ladder = RefinementSettings(steps=9).ladder()
    tried, judged = (
        [rates_of(flown(with_constant_moment(policy, float(m)), world, rollouts)) for m in ladder]
        for world in (MEASURED_WORLD, dataclasses.replace(MEASURED_WORLD, seed=8))
    )
    best = np.array([one.four for one in tried]).argmax(axis=0)[None]
    four, clean = (np.take_along_axis(np.array(of), best, axis=0)[0] for of in zip(*judged, strict=True))
    return Rates(four, clean)


def inside_band(condition: Condition, low: float, high: float, fast: bool) -> bool:
    """Whether an approach is of that band."""
    return low <= condition.angle_deg < high and (condition.speed >= FAST) == fast


def of_worlds(flying: dict[str, Policy], bases: dict[str, Rates], rollouts: int) -> Iterator[Change]:
    """What another world would change: of the policies as they are, the changes by name of the policy."""
    with tempfile.TemporaryDirectory() as folder:
        for kind, what, setup in worlds(Path(folder)):
            found = {
                name: compared(rates_of(flown(policy, setup, rollouts)), bases[name])
                for name, policy in flying.items()
            }
            yield kind, what, found


def of_learning(rollouts: int, attempts: int) -> Iterator[Change]:
    """What another world would change for a policy that is learned there, over one that is learned here."""
    base = rates_of(flown(learned(MEASURED_WORLD, attempts), MEASURED_WORLD, rollouts))
    yield "policy", "nothing changed", compared(base, base)
    with tempfile.TemporaryDirectory() as folder:
        for kind, what, setup in worlds(Path(folder)):
            yield kind, what, compared(rates_of(flown(learned(setup, attempts), setup, rollouts)), base)


def by_change(flying: dict[str, Policy], rollouts: int) -> list[dict[str, Any]]:
    """All changes with the rates of each policy, best clean rate first."""
    bases = {name: rates_of(flown(policy, MEASURED_WORLD, rollouts)) for name, policy in flying.items()}
    own: dict[tuple[str, str], dict[str, Any]] = {
        ("policy", "nothing changed"): {name: compared(base, base) for name, base in bases.items()}
    }
    for name, policy in flying.items():
        for kind, what, found in of_the_policy(policy, bases[name], rollouts):
            own.setdefault((kind, what), {})[name] = found
    changes = [
        *((*change, found) for change, found in own.items()),
        *of_worlds(flying, bases, rollouts),
    ]
    changes.sort(key=lambda change: -max(of["landing_rate"]["rate"] for of in change[2].values()))
    return [{"kind": kind, "what": what, "policies": found} for kind, what, found in changes]


def main(arguments: list[str] | None = None) -> None:
    """Fly all, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data", type=Path, required=True, help="the shared data, with habas2022/ in it")
    parser.add_argument(
        "--policies", nargs="+", default=["measured", "pads"], help="that changes are flown with"
    )
    parser.add_argument("--rollouts", type=int, default=100, help="attempts at each condition")
    parser.add_argument("--attempts", type=int, default=40_000, help="that a policy is learned from anew")
    chosen = parser.parse_args(arguments)
    flying = {name: load_policy(find_policy(name)) for name in chosen.policies}
    anew = of_learning(chosen.rollouts, chosen.attempts) if chosen.attempts else ()
    document = {
        "benchmark": "landing_advice",
        "conditions": len(GRID),
        "conditions_inside_judged_range": inside_judged_range(GRID),
        "policies": of_policies(chosen.data, chosen.rollouts),
        "changes": by_change(flying, chosen.rollouts),
        "learned_anew": [{"kind": kind, "what": what, **found} for kind, what, found in anew],
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
