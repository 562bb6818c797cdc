"""EPHE: a normal distribution moves towards its own best samples (Wang et al., paper section III.C).

The parameters are (10 tau_critical [s], moment [N mm, positive = nose up]), as in the authors' code, so that
both are of order one; the hyperparameters, which the paper does not print, are the authors' (errata 11).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from onboard.arrays import FloatArray, IntArray
from onboard.jit import kept

TAU_SCALE = 10.0
"""First parameter per second of tau."""

MOMENT_SCALE = -1e-3
"""a_rot (N m, negative = nose up) per unit of the second parameter."""

START_TAU = (0.18, 0.22, 0.24)
"""s, mean of tau at the start of the three repeats."""


EPISODES_MOST = 15
"""Episodes in which the distribution may move; the history of a trial has room for as many."""


class EpheSettings(NamedTuple):
    """Hyperparameters.

    Attributes:
        rollouts: samples an episode.
        best: of them that update the distribution.
        episodes: at most; no more than :data:`EPISODES_MOST`.
        evaluation_episodes: with the final distribution.
        sigma_stop: converged when both standard deviations are below.
        sigma_tau, sigma_moment: at the start.
        moment_low, moment_high: range of the moment's mean at the start (uniform).
        tau_most, moment_most: samples lie between 0 and these.
    """

    rollouts: int = 6
    best: int = 3
    episodes: int = EPISODES_MOST
    evaluation_episodes: int = 3
    sigma_stop: float = 0.05
    sigma_tau: float = 0.5
    sigma_moment: float = 1.5
    moment_low: float = 3.0
    moment_high: float = 8.0
    tau_most: float = 6.0
    moment_most: float = 10.0


@kept()
def truncated_normal(rng: Any, mu: float, sigma: float, low: float, high: float) -> float:
    """A sample of a normal distribution that lies within [low, high].

    By rejection; a mean so far outside that this would not end gives the nearer bound.
    """
    for _ in range(1000):
        sample = mu + sigma * rng.standard_normal()
        if low <= sample <= high:
            return sample
    return min(max(mu, low), high)


@kept()
def sample(rng: Any, mu: FloatArray, sigma: FloatArray, s: EpheSettings) -> tuple[float, float]:
    """One sample of both parameters."""
    tau = truncated_normal(rng, mu[0], sigma[0], 0.0, s.tau_most)
    moment = truncated_normal(rng, mu[1], sigma[1], 0.0, s.moment_most)
    return tau, moment


@kept()
def _best_first(rewards: FloatArray, count: int) -> IntArray:
    """Indices of the `count` best (all, where there are no more), of equal ones the earlier first. Numba's
    own sort takes seconds to compile."""
    order = np.empty(min(count, len(rewards)), np.int64)
    left = np.ones(len(rewards), np.bool_)
    for place in range(len(order)):
        best = -1
        for k in range(len(rewards)):
            if left[k] and (best < 0 or rewards[k] > rewards[best]):
                best = k
        order[place] = best
        left[best] = False
    return order


@kept()
def update(
    theta: FloatArray, rewards: FloatArray, best: int,
    mu: FloatArray, sigma: FloatArray,
) -> None:  # fmt: skip
    """Move the distribution to its best samples, weighted with their rewards; changes `mu` and `sigma`.

    mu' = sum(r theta) / (sum r + 1e-3), sigma'^2 = sum(r (theta - mu)^2) / (sum r + 1e-3), with the old mean
    in the second.

    Args:
        theta: (n, 2) samples.
        rewards: (n,).
        best: how many count.
        mu, sigma: (2,).
    """
    order = _best_first(rewards, best)
    total = 1e-3
    for k in order:
        total += rewards[k]
    for i in range(2):
        mean, spread = 0.0, 0.0
        for k in order:
            mean += rewards[k] * theta[k, i]
            spread += rewards[k] * (theta[k, i] - mu[i]) ** 2
        mu[i] = mean / total
        sigma[i] = math.sqrt(spread / total)


@kept()
def converged(sigma: FloatArray, s: EpheSettings) -> bool:
    """Whether the distribution is narrow enough to stop."""
    return sigma[0] < s.sigma_stop and sigma[1] < s.sigma_stop
