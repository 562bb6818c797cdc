"""Validation: how often a two-stage policy lands, condition by condition."""

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from onboard.jit import alone
from onboard.policy.files import Policy
from perchhw.learning.executor import ALL_CORES, Executor
from perchhw.learning.grid import Condition, generator
from perchhw.learning.one_trial import not_finite_rollouts
from perchhw.learning.setup import LearningSetup, Recipe, prepared
from perchhw.learning.sweep_folder import Row, cell, write_file
from perchhw.learning.trial import TRIAL, Rules, TrialMemory, fly_next, new_bench, summarise

_PURPOSE = 2

COLUMNS = (
    "speed_m_s", "angle_deg", "trigger_rate", "landing_rate", "four_leg_rate", "two_leg_rate",
    "body_contact_rate", "tau", "theta_x", "d_ceil", "a_rot", "rollouts", "not_finite_rollouts",
)  # fmt: skip


@alone
def try_policy(
    rng: Any,
    bench: TrialMemory,
    policy: Any,
    speed: float,
    angle: float,
    rules: Rules,
    count: int,
    trial: Any,
) -> None:
    """`count` rollouts of a policy at one condition into `trial`."""
    for _ in range(count):
        trial.reward += fly_next(rng, bench, policy, speed, angle, rules, trial) / count
    summarise(bench.outs[:count], trial)


@dataclass(frozen=True)
class FlyPolicy:
    """The work of a validation on one condition, as an executor takes it."""

    recipe: Recipe
    policy: Policy
    rollouts: int

    def __call__(self, condition: Condition) -> Row:
        """The row of one condition."""
        parameters, rules = prepared(self.recipe)
        bench = new_bench(parameters, self.rollouts)
        rng = generator(self.recipe.setup.seed, _PURPOSE, condition)
        angle = math.radians(condition.angle_deg)
        try_policy(
            rng, bench, self.policy.compiled(), condition.speed, angle, rules, self.rollouts, new_trial()
        )
        return rates_row(condition, bench.outs)


def new_trial() -> Any:
    """A record of :data:`~perchhw.learning.trial.TRIAL`, zeroed."""
    return np.zeros(1, TRIAL)[0]


def rates_row(condition: Condition, outs: Any) -> Row:
    """The row of one condition: its attempts' rates, and mean cues where any triggered.

    Args:
        outs: records of :data:`sim_backend.physics.rollout.ROLLOUT`, one an attempt.
    """
    trial = new_trial()
    summarise(outs, trial)
    row: Row = {
        "speed_m_s": condition.speed,
        "angle_deg": condition.angle_deg,
        "trigger_rate": float(np.mean(outs["triggered"])),
        "rollouts": len(outs),
        "not_finite_rollouts": " ".join(map(str, not_finite_rollouts(outs))) or None,
    }
    for name in COLUMNS[3:-2]:
        value = float(trial[name])
        row[name] = value if math.isfinite(value) else None
    return row


def validate_policy(
    policy: Policy,
    setup: LearningSetup,
    grid: Sequence[Condition],
    *,
    rollouts: int = 18,
    executor: Executor = ALL_CORES,
    on_condition: Callable[[Row, int, int], None] = lambda row, done, total: None,
) -> tuple[Row, ...]:
    """Fly a policy at every condition; rows as :data:`COLUMNS`, in the order of the grid.

    Args:
        policy: two-stage policy.
        setup: vehicle, randomisation and sensing of the rollouts.
        grid: conditions.
        rollouts: of each condition.
        executor: who does the work; the result does not depend on it.
        on_condition: called with the row, the number done and the number in all.
    """
    work = FlyPolicy(setup.recipe(), policy, rollouts)
    prepared(work.recipe)
    done: dict[Condition, Row] = {}
    for condition, row in executor.spread(work, grid):
        done[condition] = row
        on_condition(row, len(done), len(grid))
    return tuple(done[condition] for condition in grid)


def write_validation(rows: Sequence[Row], path: Path) -> None:
    """Write rows as CSV; cues are empty where nothing triggered.

    Raises:
        LearningInputError: the file cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([cell(row[name]) for name in COLUMNS] for row in rows)
    write_file(path, text.getvalue())
