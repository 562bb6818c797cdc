"""One learning trial: EPHE at one approach condition, then its landing rate on fresh rollouts. Compiled."""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from onboard.controller import ControllerGains
from perchhw.learning.domain_randomisation import DomainRandomisation, draw_vehicle
from perchhw.learning.ephe import (
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
from sim_backend.physics.rollout import ROLLOUT, RolloutSettings, rollout
from sim_backend.physics.state import new_states


class Rules(NamedTuple):
    """Everything that all rollouts of a sweep share."""

    gains: ControllerGains
    domain: DomainRandomisation
    rollout: RolloutSettings
    reward: RewardWeights
    ephe: EpheSettings


class Bench(NamedTuple):
    """The memory that one worker needs for its rollouts.

    Attributes:
        nominal: (1,) parameters of the nominal vehicle.
        drawn: (1,) those of the present rollout.
        blank: (1,) a fresh state. state: (1,) that of the present rollout.
        empty: (1,) a blank result. outs: (n,) results.
    """

    nominal: Any
    drawn: Any
    blank: Any
    state: Any
    empty: Any
    outs: Any


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
    ],
    align=True,
)


def new_bench(parameters: Any, results: int) -> Bench:
    """Memory for one worker and `results` rollouts."""
    return Bench(
        nominal=parameter_batch(parameters, 1),
        drawn=parameter_batch(parameters, 1),
        blank=new_states(1),
        state=new_states(1),
        empty=np.zeros(1, ROLLOUT),
        outs=np.zeros(results, ROLLOUT),
    )


@njit(cache=True, nogil=True)
def fly(rng: Any, bench: Bench, index: int, policy: Any, speed: float, angle: float, rules: Rules) -> float:
    """One rollout with a vehicle of its own into ``bench.outs[index]``; returns its reward."""
    draw_vehicle(rng, bench.nominal[0], rules.domain, bench.drawn[0])
    bench.state[0] = bench.blank[0]
    bench.outs[index] = bench.empty[0]
    out = bench.outs[index]
    rollout(rng, bench.state[0], bench.drawn[0], rules.gains, policy, speed, angle, rules.rollout, out)
    return reward(out, rules.reward)


@njit(cache=True, nogil=True)
def fly_sample(
    rng: Any, bench: Bench, index: int, theta: Any, speed: float, angle: float, rules: Rules
) -> float:
    """One rollout of a sample (10 tau_critical, moment in N mm)."""
    policy = ThresholdPolicy(theta[0] / TAU_SCALE, theta[1] * MOMENT_SCALE)
    return fly(rng, bench, index, policy, speed, angle, rules)


@njit(cache=True, nogil=True)
def learn_pair(
    rng: Any, bench: Bench, speed: float, angle: float, start_tau: float, rules: Rules, trial: Any
) -> None:
    """Learn the threshold and the moment for one approach condition, and measure their landing rate.

    Args:
        rng: numpy Generator of this trial.
        bench: memory with room for ``rollouts * evaluation_episodes`` results.
        speed: m/s. angle: rad above the horizon.
        start_tau: s, mean of tau at the start.
        rules: of the sweep.
        trial: record of :data:`TRIAL`, zeroed; receives the result.
    """
    s = rules.ephe
    mu, sigma = trial.mu, trial.sigma
    mu[0], mu[1] = TAU_SCALE * start_tau, rng.uniform(s.moment_low, s.moment_high)
    sigma[0], sigma[1] = s.sigma_tau, s.sigma_moment
    theta, rewards = np.zeros((s.rollouts, 2)), np.zeros(s.rollouts)
    while trial.episodes < s.episodes and not trial.converged:
        for k in range(s.rollouts):
            theta[k, 0], theta[k, 1] = sample(rng, mu, sigma, s)
            rewards[k] = fly_sample(rng, bench, k, theta[k], speed, angle, rules)
            trial.steps += bench.outs[k].duration / rules.rollout.dt
            trial.not_finite += bench.outs[k].end == 4
        update(theta, rewards, s.best, mu, sigma)
        trial.episodes += 1
        trial.rollouts += s.rollouts
        trial.converged = 1 if converged(sigma, s) else 0
    count = s.rollouts * s.evaluation_episodes
    for k in range(count):
        theta[0, 0], theta[0, 1] = sample(rng, mu, sigma, s)
        trial.reward += fly_sample(rng, bench, k, theta[0], speed, angle, rules) / count
        trial.steps += bench.outs[k].duration / rules.rollout.dt
        trial.not_finite += bench.outs[k].end == 4
    trial.rollouts += count
    summarise(bench.outs, count, trial)


@njit(cache=True)
def succeeded(out: Any) -> bool:
    """Three or four legs and no contact of body or propellers."""
    return out.feet >= 3 and not out.body_contact


@njit(cache=True)
def summarise(outs: Any, count: int, trial: Any) -> None:
    """Rates of `count` rollouts, and the mean cues of those that succeeded, or triggered where none did."""
    good = 0
    for k in range(count):
        good += succeeded(outs[k])
        trial.four_leg_rate += (outs[k].feet >= 3) / count
        trial.two_leg_rate += (outs[k].feet == 1 or outs[k].feet == 2) / count
        trial.body_contact_rate += (outs[k].body_contact == 1) / count
    trial.landing_rate = good / count
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
