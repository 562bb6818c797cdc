"""Training of the action policy, and of both stages together."""

import numpy as np
import pytest

from onboard.policy.action import action_moments
from onboard.policy.files import load_policy, policy_crc32, save_policy
from onboard.policy.trigger import trigger_values
from perchhw.learning.action_policy import ActionSettings, fit_action
from perchhw.learning.train import TrainingSettings, train_policy
from perchhw.learning.training_set import TrainingSet, load_training_set
from perchhw.learning.trigger_policy import TrainingError
from tests.onboard.test_action import reference_moments


def smooth_moment(scaled):
    return -6.5e-3 + 1.0e-3 * np.tanh(scaled[:, 0]) - 0.5e-3 * scaled[:, 1]


def quick(epochs):
    return TrainingSettings(action=ActionSettings(epochs=epochs))


@pytest.fixture(scope="module")
def pairs():
    """Pairs of a known moment over a blob of states."""
    scaled = np.random.default_rng(6).normal(size=(120, 3))
    states = np.array([0.23, 4.0, 0.48]) + np.array([0.0135, 2.0, 0.1]) * scaled
    return TrainingSet(states, smooth_moment(scaled), np.ones(120), {"table": "synthetic"})


@pytest.mark.further
def test_learns_a_smooth_moment():
    scaled = np.random.default_rng(7).normal(size=(200, 3))
    fit = fit_action(scaled, smooth_moment(scaled), ActionSettings(epochs=1500), seed=0)
    assert fit.train_rms < 0.1e-3
    assert fit.held_out_rms < 0.3e-3
    assert [layer.weights.shape for layer in fit.layers] == [(10, 3), (10, 10), (1, 10)]


@pytest.mark.further
def test_pairs_held_back_do_not_teach():
    scaled = np.random.default_rng(8).normal(size=(50, 3))
    moments = smooth_moment(scaled)
    fit = fit_action(scaled, moments, ActionSettings(epochs=20), seed=3)
    assert len(fit.held_out_indices) == 5
    assert set(fit.held_out_indices) | set(fit.train_indices) == set(range(50))
    changed = moments.copy()
    changed[fit.held_out_indices] *= 2
    again = fit_action(scaled, changed, ActionSettings(epochs=20), seed=3)
    for one, other in zip(fit.layers, again.layers, strict=True):
        np.testing.assert_array_equal(one.weights, other.weights)
    assert again.held_out_rms > fit.held_out_rms


@pytest.mark.further
def test_the_same_seed_gives_the_same_policy(pairs):
    import torch

    before = torch.random.get_rng_state()
    policies = [train_policy(pairs, quick(30), seed=seed).policy for seed in (1, 1, 2)]
    assert torch.equal(torch.random.get_rng_state(), before)
    crcs = [policy_crc32(policy) for policy in policies]
    assert crcs[0] == crcs[1] != crcs[2]


def test_the_policy_computes_what_was_trained(pairs, tmp_path):
    settings = TrainingSettings(gamma=1.0, nu=0.2, action=ActionSettings(hidden=(8, 6, 4), epochs=300))
    result = train_policy(pairs, settings, name="blob", seed=5)
    save_policy(result.policy, tmp_path / "blob.policy.json")
    policy = load_policy(tmp_path / "blob.policy.json")
    assert policy.layer_sizes == (3, 8, 6, 4, 1)
    states = pairs.states.astype(np.float32)
    free = reference_moments(policy, states)
    train = result.action.train_indices
    rms = np.sqrt(np.mean((free - pairs.a_rot)[train] ** 2))
    assert rms == pytest.approx(result.action.train_rms, rel=1e-3)
    limited = np.clip(free, policy.a_rot_min, policy.a_rot_max)
    np.testing.assert_allclose(action_moments(policy.compiled(), states), limited, atol=1e-8)
    inside = np.mean(trigger_values(policy.compiled(), states) >= 0)
    assert inside == pytest.approx(result.trigger.inside_share, abs=0.02)
    assert policy.provenance["gamma"] == 1.0
    assert policy.provenance["hidden"] == [8, 6, 4]
    assert policy.provenance["pairs"] == {"table": "synthetic"}


def test_moments_stay_within_the_pairs_and_the_vehicle(pairs):
    free = train_policy(pairs, quick(5), seed=1).policy
    assert free.a_rot_min == np.float32(pairs.a_rot.min())
    assert free.a_rot_max == np.float32(pairs.a_rot.max())
    weak = TrainingSettings(action=ActionSettings(epochs=5), a_rot_strongest=-7e-3)
    assert train_policy(pairs, weak, seed=1).policy.a_rot_min == np.float32(-7e-3)


def test_too_few_pairs_are_refused():
    with pytest.raises(TrainingError, match="too few"):
        fit_action(np.ones((1, 3)), np.ones(1), seed=0)


def test_the_authors_pairs_train_a_policy_like_the_flown_one(shared_data):
    from onboard.policy.files import import_authors_policy

    pairs = load_training_set(shared_data / "habas2022/policy/training_set_NL.csv")
    result = train_policy(pairs, seed=1)
    flown = import_authors_policy(shared_data / "habas2022/policy/flown_policy.json")
    states = pairs.states.astype(np.float32)
    inside = states[trigger_values(flown.compiled(), states) >= 0]
    difference = action_moments(result.policy.compiled(), inside) - action_moments(flown.compiled(), inside)
    # The pairs scatter by 1 N mm about any smooth moment; two networks differ by less.
    assert np.median(np.abs(difference)) < 0.5e-3
    assert result.action.train_rms < 1.2e-3
    assert result.action.held_out_rms < 1.6e-3
