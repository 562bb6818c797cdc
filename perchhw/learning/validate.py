"""Validation: how often a two-stage policy lands, condition by condition."""

import csv
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from onboard.policy.files import Policy
from perchhw.learning.bands import Row
from perchhw.learning.bands import band_table as band_table
from perchhw.learning.bands import best_per_condition as best_per_condition
from perchhw.learning.grid import Condition, generator, spread
from perchhw.learning.setup import LearningSetup
from perchhw.learning.trial import TRIAL, Bench, Rules, fly, new_bench, summarise

_PURPOSE = 2

COLUMNS = (
    "speed_m_s", "angle_deg", "trigger_rate", "landing_rate", "four_leg_rate", "two_leg_rate",
    "body_contact_rate", "tau", "theta_x", "d_ceil", "a_rot", "rollouts",
)  # fmt: skip


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
