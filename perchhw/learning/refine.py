"""Refinement of the action policy: which moment lands from where the trained trigger really fires.

A trigger fires where an approach enters its region, a little before the cues of the pairs that made it; and
the moments of pairs at one condition differ by about 1 N mm, because EPHE stops anywhere in a valley of good
pairs. So the trained trigger is flown at every condition with a ladder of constant moments, and the action
network learns, at the cues where it fired, the middle of the range of moments that land there. This is one
round of dataset aggregation (Ross, Gordon, Bagnell, AISTATS 2011) and goes beyond the paper.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from onboard.arrays import FloatArray
from onboard.policy.files import Policy
from onboard.policy.model import PAPER_A_ROT_LIMIT, ActionLayer
from perchhw.learning.action_policy import ActionSettings, fit_action
from perchhw.learning.executor import ALL_CORES, Executor
from perchhw.learning.grid import Condition, generator
from perchhw.learning.setup import LearningSetup, Recipe, prepared
from perchhw.learning.trial import TRIAL, new_bench
from perchhw.learning.trigger_policy import TrainingError
from perchhw.learning.validate import try_policy

_PURPOSE = 4


@dataclass(frozen=True)
class RefinementSettings:
    """How the moments are tried.

    Attributes:
        weakest, strongest: N m, negative: ends of the ladder.
        steps: moments on it.
        rollouts: with each moment at each condition.
        landing_rate_min: of the best moment; conditions where none reaches it teach nothing.
        range_share: moments count as landing from this share of the best rate on.
        cues: firing states that a condition gives to the network.
    """

    weakest: float = -2e-3
    strongest: float = -PAPER_A_ROT_LIMIT
    steps: int = 16
    rollouts: int = 12
    landing_rate_min: float = 0.5
    range_share: float = 0.9
    cues: int = 8

    def ladder(self) -> FloatArray:
        """The moments, N m, from weak to strong."""
        return np.linspace(self.weakest, self.strongest, self.steps)


@dataclass(frozen=True)
class Firing:
    """What one condition showed.

    Attributes:
        states: (n, 3) cues at which the trigger fired.
        landing_rates: (steps,) of the rollouts that fired, with each moment.
    """

    states: FloatArray
    landing_rates: FloatArray


@dataclass(frozen=True)
class FlyLadder:
    """The trigger with each moment of the ladder at one condition, as an executor takes it."""

    recipe: Recipe
    policy: Policy
    settings: RefinementSettings

    def __call__(self, condition: Condition) -> Firing:
        """Where the trigger fires, and how often each moment lands from there."""
        parameters, rules = prepared(self.recipe)
        rng = generator(self.recipe.setup.seed, _PURPOSE, condition)
        bench = new_bench(parameters, self.settings.rollouts)
        angle = math.radians(condition.angle_deg)
        states, rates = [], []
        for moment in self.settings.ladder():
            compiled = with_constant_moment(self.policy, float(moment)).compiled()
            trial = np.zeros(1, TRIAL)[0]
            try_policy(rng, bench, compiled, condition.speed, angle, rules, self.settings.rollouts, trial)
            fired = bench.outs[bench.outs["triggered"] == 1]
            landed = (fired["feet"] >= 3) & (fired["body_contact"] == 0)
            rates.append(float(landed.mean()) if len(fired) else 0.0)
            states.append(np.stack([fired["tau"], fired["theta_x"], fired["d_ceil"]], axis=1))
        return Firing(np.concatenate(states), np.array(rates))


def with_constant_moment(policy: Policy, a_rot: float) -> Policy:
    """The trigger of a policy with an action that does not look at the cues (`a_rot` in N m, negative)."""
    layer = ActionLayer(np.zeros((1, 3), np.float32), np.array([a_rot], np.float32))
    strongest = np.float32(-PAPER_A_ROT_LIMIT)
    return replace(policy, layers=(layer,), a_rot_min=strongest, a_rot_max=np.float32(0.0), provenance={})


def middle_of_landing_range(moments: FloatArray, rates: FloatArray, range_share: float) -> float:
    """The middle (N m) of the neighbouring moments that land nearly as often as the best one.

    The rates are smoothed over three moments first, because each comes from few rollouts.
    """
    padded = np.pad(rates, 1, mode="edge")
    smooth = 0.25 * padded[:-2] + 0.5 * padded[1:-1] + 0.25 * padded[2:]
    first = last = int(np.argmax(smooth))
    good = smooth >= range_share * smooth[first]
    while first > 0 and good[first - 1]:
        first -= 1
    while last < len(moments) - 1 and good[last + 1]:
        last += 1
    return float(0.5 * (moments[first] + moments[last]))


def refine_action(
    policy: Policy,
    setup: LearningSetup,
    grid: Sequence[Condition],
    *,
    settings: RefinementSettings | None = None,
    action: ActionSettings | None = None,
    executor: Executor = ALL_CORES,
    on_condition: Callable[[int, int], None] = lambda done, total: None,
) -> Policy:
    """The policy with its trigger kept and its action trained anew on where that trigger fires.

    Args:
        policy: two-stage policy.
        setup: what the rollouts run on.
        grid: conditions to fly at.
        settings: of the ladder; action: of the network; the defaults without them.
        executor: who does the work; the result does not depend on it.
        on_condition: called with the number done and the number in all.

    Raises:
        TrainingError: the trigger fires at too few conditions from which any moment lands.
    """
    settings = settings or RefinementSettings()
    work = FlyLadder(setup.recipe(), policy, settings)
    prepared(work.recipe)
    firings: dict[Condition, Firing] = {}
    for condition, firing in executor.spread(work, grid):
        firings[condition] = firing
        on_condition(len(firings), len(grid))
    states, moments, conditions = _examples([firings[condition] for condition in grid], settings)
    scaled = (states - policy.scaler_mean) / policy.scaler_std
    fit = fit_action(scaled.astype(np.float64), moments, action, seed=setup.seed)
    refinement = {
        "conditions": conditions,
        "examples": len(moments),
        "train_rms_nm": fit.train_rms,
        "held_out_rms_nm": fit.held_out_rms,
    }
    return replace(
        policy,
        layers=fit.layers,
        a_rot_min=np.float32(moments.min()),
        a_rot_max=np.float32(moments.max()),
        provenance={**policy.provenance, "refinement": refinement},
    )


def _examples(firings: Sequence[Firing], settings: RefinementSettings) -> tuple[FloatArray, FloatArray, int]:
    """Firing states (n, 3), their moments (n,), and from how many conditions they come."""
    ladder = settings.ladder()
    states, moments, conditions = [], [], 0
    for firing in firings:
        if len(firing.states) < settings.cues or firing.landing_rates.max() < settings.landing_rate_min:
            continue
        chosen = np.linspace(0, len(firing.states) - 1, settings.cues).astype(int)
        moment = middle_of_landing_range(ladder, firing.landing_rates, settings.range_share)
        states.append(firing.states[chosen])
        moments.append(np.full(settings.cues, moment))
        conditions += 1
    if conditions < 2:
        raise TrainingError(
            f"the trigger fires at {conditions} conditions from which a moment lands: refine on a wider grid"
        )
    return np.concatenate(states), np.concatenate(moments), conditions
