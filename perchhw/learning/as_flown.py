"""How often a policy lands with everything on board in the loop: the validation that a lab will see."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from onboard.policy.bundle import encode_bundle
from onboard.policy.files import Policy
from onboard.room import RoomGeometry
from onboard.trajectory import ApproachError, fit_approach
from perchhw.learning.domain_randomisation import draw_vehicle
from perchhw.learning.executor import Executor, LocalThreads
from perchhw.learning.grid import Condition, generator
from perchhw.learning.setup import LearningSetup, Recipe, prepared
from perchhw.learning.sweep_folder import Row
from perchhw.learning.validate import rates_row
from sim_backend.engine_name import EngineName
from sim_backend.physics.parameters import parameter_batch
from sim_backend.physics.rollout import ROLLOUT
from sim_backend.whole_attempt import WholeAttempts

ONE_CORE = LocalThreads(1)
"""Most of the work holds the interpreter's lock: threads would wait for each other."""

_PURPOSE = 5


@dataclass(frozen=True)
class FlyWhole:
    """The work on one condition, as an executor takes it."""

    recipe: Recipe
    policy: Policy
    flights: int
    engine: EngineName

    def __call__(self, condition: Condition) -> Row:
        """The row of one condition."""
        parameters, rules = prepared(self.recipe)
        setup = self.recipe.setup
        room = RoomGeometry(ceiling_z=setup.ceiling_z)
        plan = fit_approach(condition.speed, condition.angle_deg, room)
        attempts = WholeAttempts(setup.load_vehicle(), encode_bundle(self.policy), self.engine)
        rng = generator(setup.seed, _PURPOSE, condition)
        nominal, drawn = parameter_batch(parameters, 1), parameter_batch(parameters, 1)
        outs = np.zeros(self.flights, ROLLOUT)
        for out in outs:
            out["speed"], out["angle"] = condition.speed, math.radians(condition.angle_deg)
            draw_vehicle(rng, nominal, rules.domain, drawn)
            attempts.fly(drawn, plan, rng, out)
        return rates_row(condition, outs)


def flyable(grid: Sequence[Condition], ceiling_z: float) -> tuple[Condition, ...]:
    """Conditions whose approach fits the room under a ceiling of this height (m)."""

    def fits(condition: Condition) -> bool:
        try:
            fit_approach(condition.speed, condition.angle_deg, RoomGeometry(ceiling_z=ceiling_z))
        except ApproachError:
            return False
        return True

    return tuple(condition for condition in grid if fits(condition))


def fly_policy(
    policy: Policy,
    setup: LearningSetup,
    grid: Sequence[Condition],
    *,
    flights: int,
    engine: EngineName,
    executor: Executor = ONE_CORE,
    on_condition: Callable[[Row, int, int], None] = lambda row, done, total: None,
) -> tuple[Row, ...]:
    """As :func:`perchhw.learning.validate.validate_policy`, with all that is on board in the loop.

    Sensing and gains of `setup` are not asked: the cues are those of the estimator, the law is the drone's.

    Args:
        policy: two-stage policy.
        setup: vehicle, its randomisation, ceiling, seed.
        grid: conditions.
        flights: of each condition.
        engine: which code computes on board.
        executor: who does the work; the result does not depend on it.
        on_condition: called with the row, the number done and the number in all.

    Raises:
        ApproachError: a condition that fits no room of this height.
        SimulationError: the drone refuses the policy.
    """
    work = FlyWhole(setup.recipe(), policy, flights, engine)
    prepared(work.recipe)
    done: dict[Condition, Row] = {}
    for condition, row in executor.spread(work, grid):
        done[condition] = row
        on_condition(row, len(done), len(grid))
    return tuple(done[condition] for condition in grid)
