"""Attempts at random: approach, threshold and moment are drawn anew for each."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.measurement import Interval
from onboard.policy.model import PAPER_A_ROT_LIMIT
from perchhw.learning.executor import ALL_CORES, Executor
from perchhw.learning.grid import Condition, generator
from perchhw.learning.setup import LearningSetup, Recipe, prepared
from perchhw.learning.trial import fly, new_bench
from sim_backend.physics.decision import ThresholdPolicy

_PURPOSE = 6
_BATCH = 5000
"""Attempts that share a generator."""

TAUS = (0.14, 0.34)
"""s, range of the threshold."""

MOMENTS = (-PAPER_A_ROT_LIMIT, -2e-3)
"""N m, range of the flip's moment."""


@dataclass(frozen=True)
class FlyAtRandom:
    """The work on one batch, as an executor takes it.

    Attributes:
        speeds: m/s. angles_deg: deg above the horizon. Both are ranges of the approach.
    """

    recipe: Recipe
    speeds: Interval
    angles_deg: Interval

    def __call__(self, task: tuple[int, int]) -> Any:
        """Results of one batch: its number, and how many attempts it has."""
        batch, count = task
        parameters, rules = prepared(self.recipe)
        bench = new_bench(parameters, count)
        rng = generator(self.recipe.setup.seed, _PURPOSE, Condition(0.0, 0.0), batch)
        for index in range(count):
            speed, angle_deg, tau, moment = (
                rng.uniform(*bounds) for bounds in (self.speeds, self.angles_deg, TAUS, MOMENTS)
            )
            policy = ThresholdPolicy(tau, moment)
            fly(rng, bench, index, policy, speed, math.radians(angle_deg), rules)
        return bench.outs


def fly_at_random(
    setup: LearningSetup,
    speeds: Interval,
    angles_deg: Interval,
    attempts: int,
    *,
    executor: Executor = ALL_CORES,
    on_batch: Callable[[int, int], None] = lambda done, total: None,
) -> Any:
    """Results of attempts at random that triggered, records of :data:`sim_backend.physics.rollout.ROLLOUT`.

    Args:
        setup: what they run on.
        speeds: m/s. angles_deg: deg above the horizon. Ranges that approaches are drawn from, uniformly.
        attempts: in all.
        executor: who does the work; the result does not depend on it.
        on_batch: called with the number of batches done and that of all.
    """
    work = FlyAtRandom(setup.recipe(), speeds, angles_deg)
    prepared(work.recipe)
    counts = [min(_BATCH, attempts - first) for first in range(0, attempts, _BATCH)]
    batches = list(enumerate(counts))
    done: dict[tuple[int, int], Any] = {}
    for batch, results in executor.spread(work, batches):
        done[batch] = results
        on_batch(len(done), len(batches))
    outs = np.concatenate([done[batch] for batch in batches])
    return outs[outs["triggered"] == 1]
