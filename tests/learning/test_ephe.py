"""EPHE: its update by hand, its samples, and its convergence on a known landscape."""

import numpy as np
import pytest

from perchhw.learning.ephe import EpheSettings, converged, sample, truncated_normal, update


def test_update_is_the_weighted_mean_of_the_best() -> None:
    """K = 3 of 6; the spread is about the old mean (paper errata 11)."""
    theta = np.array([[2.0, 6.0], [2.4, 7.0], [1.8, 5.0], [2.2, 8.0], [3.0, 9.0], [1.0, 3.0]])
    rewards = np.array([0.2, 0.9, 0.1, 0.6, 0.5, 0.0])
    mu, sigma = np.array([2.1, 6.5]), np.array([0.5, 1.5])
    update(theta, rewards, 3, mu, sigma)
    weight = 0.9 + 0.6 + 0.5 + 1e-3
    expected_mu = [
        (0.9 * 2.4 + 0.6 * 2.2 + 0.5 * 3.0) / weight,
        (0.9 * 7.0 + 0.6 * 8.0 + 0.5 * 9.0) / weight,
    ]
    expected_sigma = [
        np.sqrt((0.9 * 0.3**2 + 0.6 * 0.1**2 + 0.5 * 0.9**2) / weight),
        np.sqrt((0.9 * 0.5**2 + 0.6 * 1.5**2 + 0.5 * 2.5**2) / weight),
    ]
    np.testing.assert_allclose(mu, expected_mu, rtol=1e-12)
    np.testing.assert_allclose(sigma, expected_sigma, rtol=1e-12)


def test_equal_rewards_keep_the_first_samples() -> None:
    """Ties are broken by order, so that a result never depends on a sorting method."""
    theta = np.arange(12.0).reshape(6, 2)
    mu, sigma = np.zeros(2), np.ones(2)
    update(theta, np.full(6, 0.5), 3, mu, sigma)
    np.testing.assert_allclose(mu, 1.5 / 1.501 * theta[:3].mean(axis=0))


def test_samples_stay_within_their_bounds() -> None:
    rng = np.random.default_rng(1)
    s = EpheSettings()
    drawn = np.array([sample(rng, np.array([0.3, 9.5]), np.array([0.5, 1.5]), s) for _ in range(500)])
    assert drawn[:, 0].min() >= 0.0
    assert drawn[:, 1].max() <= 10.0
    assert drawn[:, 0].min() < 0.1
    assert drawn[:, 1].max() > 9.8


def test_a_mean_far_outside_gives_the_nearer_bound() -> None:
    assert truncated_normal(np.random.default_rng(1), 50.0, 1e-3, 0.0, 10.0) == 10.0


@pytest.mark.parametrize("seed", range(5))
def test_it_finds_the_top_of_a_smooth_hill(seed: int) -> None:
    """Reward exp(-distance^2) around (2.3, 6.5): from the start of a trial to within the last spread."""
    rng = np.random.default_rng(seed)
    s = EpheSettings()
    mu, sigma = np.array([2.2, rng.uniform(3.0, 8.0)]), np.array([s.sigma_tau, s.sigma_moment])
    for _ in range(40):
        theta = np.array([sample(rng, mu, sigma, s) for _ in range(s.rollouts)])
        rewards = np.exp(-((theta[:, 0] - 2.3) ** 2) / 0.1 - (theta[:, 1] - 6.5) ** 2 / 10.0)
        update(theta, rewards, s.best, mu, sigma)
        if converged(sigma, s):
            break
    assert converged(sigma, s)
    assert abs(mu[0] - 2.3) < 0.3
    assert abs(mu[1] - 6.5) < 2.0
