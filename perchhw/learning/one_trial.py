"""One learning trial on its own, and one of its rollouts once more: for plots and for reports of faults."""

import math
from typing import Any, NamedTuple

import numpy as np

from perchhw.learning.ephe import EPISODES_MOST, START_TAU, sample
from perchhw.learning.errors import LearningInputError
from perchhw.learning.grid import Condition, generator
from perchhw.learning.setup import LearningSetup
from perchhw.learning.trial import (
    TRIAL,
    Rules,
    TrialMemory,
    fly_next,
    learn_pair,
    new_bench,
    rollouts_most,
    threshold_policy,
)
from sim_backend.physics.decision import ThresholdPolicy
from sim_backend.physics.rollout import End

_PURPOSE = 1


class Trial(NamedTuple):
    """A trial and what it was made with.

    Attributes:
        record: of :data:`TRIAL`, with the history of its episodes.
        bench: ``bench.outs[: record["rollouts"]]`` are the results of all its rollouts.
        rng: as the trial left it.
    """

    record: Any
    bench: TrialMemory
    rng: np.random.Generator


class TrialRollout(NamedTuple):
    """One rollout of a trial.

    Attributes:
        policy: threshold (s) and moment (N m) that it tried.
        parameters: physics parameters of its vehicle. state: the last state.
        out: record of :data:`sim_backend.physics.rollout.ROLLOUT`.
    """

    policy: ThresholdPolicy
    parameters: Any
    state: Any
    out: Any


def run_trial(
    parameters: Any, rules: Rules, seed: int, condition: Condition, repeat: int, stop: int = -1
) -> Trial:
    """One trial, on a bench and random numbers of its own; ends before rollout `stop` unless negative.

    Raises:
        LearningInputError: the rules have more episodes than the history of a trial.
    """
    if rules.ephe.episodes > EPISODES_MOST:
        raise LearningInputError(f"{rules.ephe.episodes} episodes: give {EPISODES_MOST} at most")
    record = np.zeros(1, TRIAL)[0]
    bench = new_bench(parameters, rollouts_most(rules.ephe))
    rng = generator(seed, _PURPOSE, condition, repeat)
    start_tau = START_TAU[repeat % len(START_TAU)]
    learn_pair(rng, bench, condition.speed, math.radians(condition.angle_deg), start_tau, rules, record, stop)
    return Trial(record, bench, rng)


def not_finite_rollouts(outs: Any) -> tuple[int, ...]:
    """Which rollouts, counted from 0, ended because their state was no longer finite."""
    return tuple(int(index) for index in np.flatnonzero(outs["end"] == End.NOT_FINITE))


def learn_one(setup: LearningSetup, condition: Condition, repeat: int) -> Any:
    """The trial of a sweep with this setup, learned again: record of :data:`TRIAL`.

    ``mu_history`` and ``sigma_history`` (EPISODES_MOST, 2) hold the distribution that each episode sampled,
    in the units of EPHE (10 tau_critical [s], moment [N mm]), ``reward_history`` (EPISODES_MOST,) the mean
    reward of its samples; the first ``episodes`` rows count. ``mu`` and ``sigma`` are the final distribution.
    """
    return run_trial(*setup.load(), setup.seed, condition, repeat).record


def fly_again(setup: LearningSetup, condition: Condition, repeat: int, rollout: int) -> TrialRollout:
    """One rollout of a sweep, flown again exactly, as a report of a fault names it.

    Args:
        setup: of the sweep (``settings`` in ``sweep.json``).
        condition: speed and angle. repeat: column ``trial``. rollout: counted from 0 within the trial.

    Raises:
        LearningInputError: the trial has fewer rollouts.
    """
    parameters, rules = setup.load()
    count = int(run_trial(parameters, rules, setup.seed, condition, repeat).record["rollouts"])
    if not 0 <= rollout < count:
        raise LearningInputError(f"rollout {rollout}: the trial has the rollouts 0 to {count - 1}")
    record, bench, rng = run_trial(parameters, rules, setup.seed, condition, repeat, stop=rollout)
    policy = threshold_policy(sample(rng, record["mu"], record["sigma"], rules.ephe))
    angle = math.radians(condition.angle_deg)
    fly_next(rng, bench, policy, condition.speed, angle, rules, record)
    return TrialRollout(policy, bench.drawn[0], bench.state[0], bench.outs[rollout])
