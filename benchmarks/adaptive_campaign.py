"""How many attempts an adaptive campaign saves, on drawn maps of the landing rate.

    python benchmarks/adaptive_campaign.py [--maps 4] [--repeats 3] [--seed 0] [--simulated 4] [--sweeps DIR]

Truth: maps of five shapes over 7 speeds and 6 angles (tests/truth/landing_rate_maps.py), none of the
surrogate's family. Apart from these `--simulated` landing-rate maps of the shipped policy, each of a
vehicle of its own that is drawn by the uncertainties of the vehicle file, half of them as real approaches
scatter; and with `--sweeps` the best rates of the tables `*_LR_Trials*.csv` of the paper's authors there,
each over two grids of that size. A grid flies every condition `repeats` times. Its map is judged twice: by
the share of landings at each condition, and smoothed by the surrogate of the adaptive campaign. Errors are
root mean squares over conditions and maps. The adaptive campaign, and a shuffled grid that is broken off,
have 60 % of the attempts. Shares are those of the attempts from which on the adaptive campaign's error
stays below the grid's (1: all of them, or more). What knowledge of the truth would save is said twice:
without smoothing, if attempts went to each condition as its standard deviation asks (Neyman's allocation);
and smoothed alike, by the allocation that lowers the expected error of the surrogate's own map most
(Bayesian A-optimal design, to first order about the true rates). Intervals are of 95 %, by bootstrap over
maps. Prints one JSON document.
"""

import argparse
import json
import math
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))


from onboard.arrays import FloatArray
from onboard.policy.files import load_policy, shipped_policy_path
from perchhw.attempt import DEFAULT_POLICY
from perchhw.learning.grid import Condition, generator
from perchhw.learning.results import read_reference
from perchhw.learning.setup import MEASURED, LearningSetup, prepared
from perchhw.learning.trial import new_bench
from perchhw.learning.validate import new_trial, rates_row, try_policy
from tests.truth.landing_rate_maps import SHAPES, DrawnMap, KnownMap

CONDITIONS = [(float(speed), float(angle)) for speed in np.linspace(2, 3, 7) for angle in range(30, 61, 6)]
SHARE = 0.6
CHECKED = 20
"""Places along a campaign where its map is judged."""
SIMULATED = [(round(2.0 + 0.2 * i, 2), 35.0 + 6.0 * j) for i in range(7) for j in range(6)]
"""The grid of the simulated truths: where the shipped policy lands sometimes."""
ROLLOUTS = 200
"""Of each condition: its rate is then known to 0.035, which is a truth of its own."""
DRAWS = 1000
LEAST_WEIGHT = 0.02
"""Length scales and amplitudes that weigh less are left out of the best allocation."""

SWEPT = [
    [(round(1.5 + 0.3 * i + 0.1 * grid, 2), 30.0 + 7.5 * j + 3.75 * grid) for i in range(7) for j in range(6)]
    for grid in (0, 1)
]
"""Two grids of the authors' sweeps that have no condition in common."""


def drawn(shape: str, seeds: list[int], repeats: int) -> Iterator[KnownMap]:
    """The maps of one shape."""
    for seed in seeds:
        yield DrawnMap(shape, CONDITIONS, seed, repeats * len(CONDITIONS))


def swept(folder: Path, seed: int, repeats: int) -> Iterator[KnownMap]:
    """The authors' sweeps as truths.

    Raises:
        PerchhwError: a table that cannot be read.
    """
    for number, table in enumerate(sorted(folder.glob("*_LR_Trials*.csv"))):
        rates = read_reference(table).rates
        for grid, conditions in enumerate(SWEPT):
            rate = np.array([rates[condition] for condition in conditions])
            rng = np.random.default_rng([seed, number, grid])
            yield KnownMap(rate, conditions, rng, repeats * len(conditions))


def simulated(number: int, seed: int, repeats: int) -> Iterator[KnownMap]:
    """Landing-rate maps of the shipped policy, each of another vehicle."""
    policy = load_policy(shipped_policy_path(DEFAULT_POLICY)).compiled()
    for k in range(number):
        sensing = MEASURED if k % 2 else "realistic"
        parameters, rules = prepared(LearningSetup(sensing=sensing, domain="vehicle", seed=seed).recipe())
        one = rules._replace(domain=rules.domain._replace(pool=rules.domain.pool[k : k + 1].copy()))
        rate = []
        for speed, angle_deg in SIMULATED:
            rng, bench = generator(seed, k, Condition(speed, angle_deg)), new_bench(parameters, ROLLOUTS)
            angle = math.radians(angle_deg)
            try_policy(rng, bench, policy, speed, angle, one, ROLLOUTS, new_trial())
            rate.append(float(rates_row(Condition(speed, angle_deg), bench.outs)["four_leg_rate"] or 0.0))
        rng = np.random.default_rng([seed, k])
        yield KnownMap(np.array(rate), SIMULATED, rng, repeats * len(SIMULATED))


def share_by_the_truth(truth: KnownMap, repeats: int) -> float:
    """The share of the grid's attempts with which the best allocation for `truth` gives the same expected
    error of the map, both smoothed by the surrogate.

    The surrogate's covariance of logits after the expected counts is that of a linear model with the
    information n p (1 - p) of n attempts (Chaloner and Verdinelli, Bayesian experimental design, 1995); it is
    averaged over length scales as the grid's own counts weigh them. The allocation is found by multiplicative
    updates, the share by bisection.
    """
    n = truth.rate.size
    rate = np.clip(truth.rate, 0.02, 0.98)
    informative = rate * (1.0 - rate)
    _, _, weight = truth.surrogate.logits(rate * repeats, truth.grid(repeats))
    heavy = np.flatnonzero(weight > LEAST_WEIGHT)
    weight = weight[heavy] / weight[heavy].sum()
    inverse = np.linalg.inv(truth.surrogate.prior[heavy] + 1e-6 * np.eye(n))

    def after(allocation: FloatArray, attempts: float) -> FloatArray:
        return np.linalg.inv(inverse + np.diag(attempts * allocation * informative))

    def error(allocation: FloatArray, attempts: float) -> float:
        variance = np.diagonal(after(allocation, attempts), axis1=1, axis2=2)
        return float(weight @ (variance @ informative**2))

    def best(attempts: float) -> float:
        allocation = np.full(n, 1.0 / n)
        for _ in range(200):
            gain = weight @ np.einsum("i,hij->hj", informative**2, after(allocation, attempts) ** 2)
            allocation = allocation * np.sqrt(informative * gain)
            allocation /= allocation.sum()
        return error(allocation, attempts)

    every = float(repeats * n)
    wanted, low, high = error(np.full(n, 1.0 / n), every), 0.05, 1.0
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if best(middle * every) > wanted else (low, middle)
    return high


def study(truths: Iterable[KnownMap], repeats: int) -> dict[str, Any]:
    """Mean square errors over maps of the size of the grid; ``path`` along the adaptive campaign."""
    most = repeats * len(CONDITIONS)
    checks = [round(most * k / CHECKED) for k in range(1, CHECKED + 1)]
    names = ("grid", "smoothed", "shuffled", "path", "expected", "deviation", "variance", "by_truth")
    errors: dict[str, list[Any]] = {name: [] for name in names}
    for truth in truths:
        every = truth.grid(repeats)
        errors["grid"].append(truth.error(truth.landed(every) / every))
        errors["smoothed"].append(truth.error(truth.known(every).rate))
        shuffled = truth.shuffled(repeats, round(SHARE * most))
        errors["shuffled"].append(truth.error(truth.known(shuffled).rate))
        steps = truth.chosen(most)
        maps = [truth.known(steps[n - 1]) for n in checks]
        errors["path"].append([truth.error(known.rate) for known in maps])
        variance = truth.rate * (1.0 - truth.rate)
        errors["variance"].append(np.mean(variance))
        errors["deviation"].append(np.mean(np.sqrt(variance)) ** 2)
        errors["by_truth"].append(share_by_the_truth(truth, repeats))
        errors["expected"].append(maps[round(SHARE * CHECKED) - 1].error ** 2)
    return errors


def figures(errors: dict[str, FloatArray]) -> dict[str, float]:
    """Root mean squares over maps, and the shares of the grid's attempts that do."""
    rms = {name: np.sqrt(np.mean(values, axis=0)) for name, values in errors.items()}
    path = rms["path"]

    def share(error: float) -> float:
        above = np.flatnonzero(path > error)
        return min(CHECKED, above[-1] + 2 if above.size else 1) / CHECKED

    return {
        "grid_shares": rms["grid"],
        "grid_smoothed": rms["smoothed"],
        "shuffled_smoothed_at_60_percent": rms["shuffled"],
        "adaptive_at_60_percent": path[round(SHARE * CHECKED) - 1],
        "adaptive_expected_at_60_percent": rms["expected"],
        "share_for_the_error_of_grid_shares": share(rms["grid"]),
        "share_for_the_error_of_grid_smoothed": share(rms["smoothed"]),
        "share_of_attempts_placed_by_the_truth": (rms["deviation"] / rms["variance"]) ** 2,
        "share_placed_by_the_truth_smoothed": np.mean(errors["by_truth"]),
    }


def summary(errors: dict[str, list[Any]]) -> dict[str, list[float]]:
    """The figures, each with its interval: value, low, high."""
    arrays = {name: np.asarray(values) for name, values in errors.items()}
    maps, rng = len(arrays["grid"]), np.random.default_rng(0)
    drawn_again = (rng.integers(0, maps, maps) for _ in range(DRAWS))
    again = [figures({name: values[which] for name, values in arrays.items()}) for which in drawn_again]
    return {
        name: [float(value), *map(float, np.percentile([one[name] for one in again], (2.5, 97.5)))]
        for name, value in figures(arrays).items()
    }


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=4, help="of each shape")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0, help="of the first map")
    parser.add_argument("--simulated", type=int, default=4, help="maps of simulated vehicles")
    parser.add_argument("--sweeps", type=Path, help="folder of the authors' sweeps")
    asked = parser.parse_args()
    seeds = list(range(asked.seed, asked.seed + asked.maps))
    shapes = {shape: study(drawn(shape, seeds, asked.repeats), asked.repeats) for shape in SHAPES}
    together = {name: [e for errors in shapes.values() for e in errors[name]] for name in shapes["cliff"]}
    if asked.simulated:
        shapes["simulated"] = study(simulated(asked.simulated, asked.seed, asked.repeats), asked.repeats)
    if asked.sweeps is not None:
        shapes["sweeps"] = study(swept(asked.sweeps, asked.seed, asked.repeats), asked.repeats)
    document = {
        "benchmark": "adaptive_campaign",
        "maps_of_each_shape": asked.maps,
        "grid_attempts": asked.repeats * len(CONDITIONS),
        "all": summary(together),
        "shapes": {shape: summary(errors) for shape, errors in shapes.items()},
    }
    json.dump(document, sys.stdout, indent=1)
    sys.stdout.write("\n")


if __name__ == "__main__":
    main()
