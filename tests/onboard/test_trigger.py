"""Trigger policy: onboard arithmetic and the tau range of its region."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.policy.files import PolicyError, import_authors_policy
from onboard.policy.trigger import trigger_value, trigger_values
from onboard.policy.trigger_region import tau_range
from tests.drawn_examples import examples
from tests.onboard.policies import policies, small_policy


def reference_values(policy, states):
    """The trigger in double precision, vectorised: written apart from the onboard loops."""
    scaled = (np.asarray(states, np.float64) - policy.scaler_mean) / policy.scaler_std
    distance = ((scaled[:, None, :] - policy.support_vectors) ** 2).sum(axis=2)
    return np.exp(-float(policy.gamma) * distance) @ policy.dual_coefficients.astype(float) + float(
        policy.intercept
    )


def states_around(policy, count, seed=1, spread=2.5):
    rng = np.random.default_rng(seed)
    return (policy.scaler_mean + policy.scaler_std * rng.uniform(-spread, spread, (count, 3))).astype(
        np.float32
    )


def test_agrees_with_double_precision():
    policy = small_policy()
    states = states_around(policy, 2000, spread=0.5)
    values = trigger_values(policy.compiled(), states)
    np.testing.assert_allclose(values, reference_values(policy, states), atol=1e-5)
    assert np.any(values >= 0)
    assert np.any(values < 0)


def test_flown_policy_agrees_with_double_precision(shared_data):
    policy = import_authors_policy(shared_data / "habas2022/policy/flown_policy.json")
    states = states_around(policy, 5000)
    values = trigger_values(policy.compiled(), states)
    np.testing.assert_allclose(values, reference_values(policy, states), atol=1e-5)


def test_one_and_many_states_agree():
    compiled = small_policy().compiled()
    states = states_around(small_policy(), 20)
    one_by_one = [trigger_value(compiled, *map(float, state)) for state in states]
    assert one_by_one == trigger_values(compiled, states).tolist()


@given(policy=policies(), theta_x=st.floats(-100, 100), d_ceil=st.floats(-1, 3))
@settings(max_examples=examples(50))
def test_never_fires_while_not_approaching_or_without_cues(policy, theta_x, d_ceil):
    compiled = policy.compiled()
    assert trigger_value(compiled, math.inf, theta_x, d_ceil) == policy.intercept
    assert not trigger_value(compiled, math.nan, theta_x, d_ceil) >= 0
    assert not trigger_value(compiled, 0.2, math.nan, d_ceil) >= 0


def ball(support_vectors, alpha, intercept, gamma=2.0, mean=(10.0, 0.0, 10.0)):
    return {
        "scaler_mean": mean,
        "scaler_std": [1.0, 1.0, 1.0],
        "support_vectors": support_vectors,
        "dual_coefficients": alpha,
        "gamma": gamma,
        "intercept": intercept,
    }


def test_tau_range_of_one_kernel_is_its_radius():
    radius = math.sqrt(math.log(1.0 / 0.5) / 2.0)
    low, high = tau_range(**ball([[0.5, 3.0, -2.0]], [1.0], -0.5), tolerance=1e-3)
    assert low <= 10.5 - radius < low + 1e-3
    assert high - 1e-3 < 10.5 + radius <= high


def test_tau_range_looks_only_below_the_ceiling():
    # Centre 1 m above the ceiling: the part of the ball with d_ceil > 0 is a cap around its lowest point.
    radius = math.sqrt(math.log(1.0 / 0.1) / 2.0)
    low, high = tau_range(**ball([[0.0, 0.0, -1.0]], [1.0], -0.1, mean=(10.0, 0.0, 0.0)), tolerance=1e-3)
    half_chord = math.sqrt(radius**2 - 1.0)
    assert low == pytest.approx(10.0 - half_chord, abs=1e-3)
    assert high == pytest.approx(10.0 + half_chord, abs=1e-3)


def test_tau_range_of_a_trigger_that_cannot_fire():
    with pytest.raises(PolicyError, match="fires nowhere"):
        tau_range(**ball([[0.0, 0.0, 0.0]], [1.0], -1.5))
    with pytest.raises(PolicyError, match="fires nowhere"):
        # Two kernels add up to more than is needed, but they are too far from each other.
        tau_range(**ball([[0.0, -3.0, 0.0], [0.0, 3.0, 0.0]], [1.0, 1.0], -1.5))
    with pytest.raises(PolicyError, match="fires nowhere in flight"):
        tau_range(**ball([[0.0, 0.0, -20.0]], [1.0], -0.5))


def test_tau_range_of_the_flown_policy(shared_data):
    policy = import_authors_policy(shared_data / "habas2022/policy/flown_policy.json")
    # Training rows: tau 0.206 to 0.278 s (notes on the authors' data); the region hugs them.
    assert policy.tau_min == pytest.approx(0.206, abs=1e-3)
    assert policy.tau_max == pytest.approx(0.278, abs=1e-3)
    rng = np.random.default_rng(2)
    states = np.column_stack(
        [rng.uniform(0.15, 0.35, 200_000), rng.uniform(-4, 14, 200_000), rng.uniform(0.01, 1.4, 200_000)]
    ).astype(np.float32)
    firing = states[trigger_values(policy.compiled(), states) >= 0]
    assert len(firing) > 1000
    assert policy.tau_min <= firing[:, 0].min()
    assert firing[:, 0].max() <= policy.tau_max
