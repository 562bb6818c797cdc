"""One learning trial: EPHE at one approach condition, then its landing rate on fresh rollouts. Compiled."""

from typing import Any, NamedTuple

import numpy as np

from onboard.controller import ControllerGains
from onboard.jit import alone, inner, kernel
from perchhw.learning.domain_randomisation import DomainRandomisation, draw_vehicle
from perchhw.learning.ephe import (
    EPISODES_MOST,
    MOMENT_SCALE,
    TAU_SCALE,
    EpheSettings,
    converged,
    sample,
    update,
)
from perchhw.learning.reward import RewardWeights, reward
from sim_backend.physics.decision import ThresholdPolicy
from sim_backend.physics.parameters import parameter_batch
from sim_backend.physics.rollout import ROLLOUT, End, RolloutSettings, rollout
from sim_backend.physics.state import new_states


class Rules(NamedTuple):
    """Everything that all rollouts of a sweep share."""

    gains: ControllerGains
    domain: DomainRandomisation
    rollout: RolloutSettings
    reward: RewardWeights
    ephe: EpheSettings


class TrialMemory(NamedTuple):
    """The memory that one worker needs for its rollouts.

    Attributes:
        nominal: (1,) parameters of the nominal vehicle.
        drawn: (1,) those of the present rollout.
        blank: (1,) a fresh state. state: (1,) that of the present rollout.
        empty: (1,) a blank result. outs: (n,) results, in the order of the rollouts.
    """

    nominal: Any
    drawn: Any
    blank: Any
    state: Any
    empty: Any
    outs: Any


_NOT_FINITE = int(End.NOT_FINITE)

TRIAL = np.dtype(
    [
        ("mu", "f8", (2,)),  # final distribution: 10 tau_critical (s), moment (N mm)
        ("sigma", "f8", (2,)),
        ("tau", "f8"),  # s, mean cues and moment of the evaluation (successful rollouts where there are any)
        ("theta_x", "f8"),
        ("d_ceil", "f8"),
        ("a_rot", "f8"),  # N m
        ("landing_rate", "f8"),  # three or four legs, no contact of body or propellers
        ("four_leg_rate", "f8"),  # three or four legs, whatever else
        ("two_leg_rate", "f8"),  # one or two legs
        ("body_contact_rate", "f8"),
        ("reward", "f8"),
        ("episodes", "i8"),
        ("rollouts", "i8"),
        ("not_finite", "i8"),
        ("converged", "i8"),
        ("steps", "f8"),  # of physics
        # For each episode: the distribution that its samples came from, and their mean reward.
        ("mu_history", "f8", (EPISODES_MOST, 2)),
        ("sigma_history", "f8", (EPISODES_MOST, 2)),
        ("reward_history", "f8", (EPISODES_MOST,)),
    ],
    align=True,
)


def rollouts_most(s: EpheSettings) -> int:
    """Rollouts that a trial can have."""
    return s.rollouts * (s.episodes + s.evaluation_episodes)


def new_bench(parameters: Any, results: int) -> TrialMemory:
    """Memory for one worker and `results` rollouts."""
    return TrialMemory(
        nominal=parameter_batch(parameters, 1),
        drawn=parameter_batch(parameters, 1),
        blank=new_states(1),
        state=new_states(1),
        empty=np.zeros(1, ROLLOUT),
        outs=np.zeros(results, ROLLOUT),
    )


@alone
def fly(
    rng: Any, bench: TrialMemory, index: int, policy: Any, speed: float, angle: float, rules: Rules
) -> float:
    """One rollout with a vehicle of its own into ``bench.outs[index]``; returns its reward.

    A rollout whose state is no longer finite has landed on nothing and earns nothing.
    """
    draw_vehicle(rng, bench.nominal, rules.domain, bench.drawn)
    bench.state[0] = bench.blank[0]
    bench.outs[index] = bench.empty[0]
    out = bench.outs[index]
    rollout(rng, bench.state[0], bench.drawn[0], rules.gains, policy, speed, angle, rules.rollout, out)
    if out.end == _NOT_FINITE:
        out.feet = out.body_contact = 0
        return 0.0
    return reward(out, rules.reward)


@alone
def fly_next(
    rng: Any, bench: TrialMemory, policy: Any, speed: float, angle: float, rules: Rules, trial: Any
) -> float:
    """The next rollout of a trial, with its counts; returns its reward."""
    index = trial.rollouts
    earned = fly(rng, bench, index, policy, speed, angle, rules)
    trial.rollouts += 1
    trial.steps += bench.outs[index].duration / rules.rollout.dt
    trial.not_finite += bench.outs[index].end == _NOT_FINITE
    return earned


@kernel
def threshold_policy(theta: Any) -> ThresholdPolicy:
    """The policy of a sample (10 tau_critical, moment in N mm)."""
    return ThresholdPolicy(theta[0] / TAU_SCALE, theta[1] * MOMENT_SCALE)


@alone
def learn_pair(
    rng: Any,
    bench: TrialMemory,
    speed: float,
    angle: float,
    start_tau: float,
    rules: Rules,
    trial: Any,
    stop: int,
) -> None:
    """Learn the threshold and the moment for one approach condition, and measure their landing rate.

    Args:
        rng: numpy Generator of this trial.
        bench: memory with room for :func:`rollouts_most` results.
        speed: m/s. angle: rad above the horizon.
        start_tau: s, mean of tau at the start.
        rules: of the sweep.
        trial: record of :data:`TRIAL`, zeroed; receives the result.
        stop: number of rollouts before which to stop, with `rng` and ``trial.mu``, ``trial.sigma`` ready for
            the next sample; negative: the whole trial.
    """
    s = rules.ephe
    mu, sigma = trial.mu, trial.sigma
    mu[0], mu[1] = TAU_SCALE * start_tau, rng.uniform(s.moment_low, s.moment_high)
    sigma[0], sigma[1] = s.sigma_tau, s.sigma_moment
    theta, rewards = np.zeros((s.rollouts, 2)), np.zeros(s.rollouts)
    while trial.episodes < s.episodes and not trial.converged:
        for i in range(2):  # two arrays of which one is assigned to the other take seconds to compile
            trial.mu_history[trial.episodes, i] = mu[i]
            trial.sigma_history[trial.episodes, i] = sigma[i]
        for k in range(s.rollouts):
            if trial.rollouts == stop:
                return
            theta[k, 0], theta[k, 1] = sample(rng, mu, sigma, s)
            rewards[k] = fly_next(rng, bench, threshold_policy(theta[k]), speed, angle, rules, trial)
        trial.reward_history[trial.episodes] = np.mean(rewards)
        update(theta, rewards, s.best, mu, sigma)
        trial.episodes += 1
        trial.converged = 1 if converged(sigma, s) else 0
    count = s.rollouts * s.evaluation_episodes
    first = trial.rollouts
    for _ in range(count):
        if trial.rollouts == stop:
            return
        theta[0, 0], theta[0, 1] = sample(rng, mu, sigma, s)
        policy = threshold_policy(theta[0])
        trial.reward += fly_next(rng, bench, policy, speed, angle, rules, trial) / count
    summarise(bench.outs[first : first + count], trial)


@inner
def succeeded(out: Any) -> bool:
    """Three or four legs and no contact of body or propellers."""
    return out.feet >= 3 and not out.body_contact


@kernel
def summarise(outs: Any, trial: Any) -> None:
    """Rates of rollouts, and the mean cues of those that succeeded, or triggered where none did."""
    count, good, four, two, touched = len(outs), 0, 0, 0, 0
    for k in range(count):
        good += succeeded(outs[k])
        four += outs[k].feet >= 3
        two += outs[k].feet == 1 or outs[k].feet == 2
        touched += outs[k].body_contact == 1
    trial.landing_rate, trial.four_leg_rate = good / count, four / count
    trial.two_leg_rate, trial.body_contact_rate = two / count, touched / count
    used = 0
    for k in range(count):
        if succeeded(outs[k]) if good > 0 else outs[k].triggered == 1:
            used += 1
            trial.tau += outs[k].tau
            trial.theta_x += outs[k].theta_x
            trial.d_ceil += outs[k].d_ceil
            trial.a_rot += outs[k].a_rot
    if used > 0:
        trial.tau /= used
        trial.theta_x /= used
        trial.d_ceil /= used
        trial.a_rot /= used
    else:
        trial.tau = trial.theta_x = trial.d_ceil = trial.a_rot = np.nan
