"""Validation: how often a two-stage policy lands, condition by condition."""

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from onboard.policy.files import Policy
from perchhw.learning.grid import Condition, generator, spread
from perchhw.learning.setup import LearningSetup
from perchhw.learning.trial import TRIAL, Bench, Rules, fly, new_bench, summarise

_PURPOSE = 2

COLUMNS = (
    "speed_m_s", "angle_deg", "trigger_rate", "landing_rate", "four_leg_rate", "two_leg_rate",
    "body_contact_rate", "tau", "theta_x", "d_ceil", "a_rot", "rollouts",
)  # fmt: skip

BANDS_DEG = ((30.0, 45.0), (45.0, 60.0), (60.0, 75.0), (75.0, 90.1))
"""Bands of the approach angle; the right bound is outside, except for 90 deg."""

FAST = 2.5
"""m/s from which an approach counts as fast in the table."""

Row = dict[str, float | int | None]


@njit(cache=True, nogil=True)
def try_policy(
    rng: Any, bench: Bench, policy: Any, speed: float, angle: float, rules: Rules, count: int, trial: Any
) -> int:
    """`count` rollouts of a policy at one condition into `trial`; returns how many triggered."""
    triggered = 0
    for k in range(count):
        trial.reward += fly(rng, bench, k, policy, speed, angle, rules) / count
        trial.steps += bench.outs[k].duration / rules.rollout.dt
        trial.not_finite += bench.outs[k].end == 4
        triggered += bench.outs[k].triggered
    trial.rollouts += count
    summarise(bench.outs, count, trial)
    return triggered


def validate_policy(
    policy: Policy,
    setup: LearningSetup,
    grid: Sequence[Condition],
    *,
    rollouts: int = 18,
    workers: int = 1,
    on_condition: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[Row, ...]:
    """Fly a policy at every condition; rows as :data:`COLUMNS`, in the order of the grid.

    Args:
        policy: two-stage policy.
        setup: vehicle, randomisation and sensing of the rollouts.
        grid: conditions.
        rollouts: of each condition.
        workers: threads; the result does not depend on it.
        on_condition: called with the number done and the number in all.
    """
    parameters, rules = setup.load()
    compiled = policy.compiled()

    def work(condition: Condition) -> Row:
        trial = np.zeros(1, TRIAL)[0]
        bench = new_bench(parameters, rollouts)
        rng = generator(setup.seed, _PURPOSE, condition)
        angle = math.radians(condition.angle_deg)
        triggered = try_policy(rng, bench, compiled, condition.speed, angle, rules, rollouts, trial)
        row: Row = {
            "speed_m_s": condition.speed,
            "angle_deg": condition.angle_deg,
            "trigger_rate": triggered / rollouts,
            "rollouts": rollouts,
        }
        for name in COLUMNS[3:-1]:
            value = float(trial[name])
            row[name] = value if math.isfinite(value) else None
        return row

    done: dict[Condition, Row] = {}
    for condition, row in spread(work, grid, workers):
        done[condition] = row
        on_condition(len(done), len(grid))
    return tuple(done[condition] for condition in grid)


def write_validation(rows: Sequence[Row], path: Path) -> None:
    """Write rows as CSV; cues are empty where nothing triggered."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for row in rows:
            writer.writerow(["" if row[name] is None else repr(row[name]) for name in COLUMNS])


def best_per_condition(rows: Sequence[Row], column: str = "landing_rate") -> dict[Condition, float]:
    """The best rate of the repeats at each condition."""
    best: dict[Condition, float] = {}
    for row in rows:
        condition = Condition(float(row["speed_m_s"] or 0), float(row["angle_deg"] or 0))
        best[condition] = max(best.get(condition, 0.0), float(row[column] or 0))
    return best


def band_table(rates: dict[Condition, float]) -> list[dict[str, Any]]:
    """Mean rate by band of angle and below or from 2.5 m/s, and over all; bands without data are left out."""
    table = []
    for low, high in BANDS_DEG:
        for fast in (False, True):
            inside = [
                rate for c, rate in rates.items() if low <= c.angle_deg < high and (c.speed >= FAST) == fast
            ]
            if inside:
                table.append(_band(f"{low:g}-{min(high, 90.0):g} deg", fast, inside))
    return [*table, _band("all", None, list(rates.values()))]


def _band(angles: str, fast: bool | None, rates: list[float]) -> dict[str, Any]:
    speeds = "all" if fast is None else f">= {FAST:g} m/s" if fast else f"< {FAST:g} m/s"
    return {"angles": angles, "speeds": speeds, "rate": float(np.mean(rates)), "conditions": len(rates)}
