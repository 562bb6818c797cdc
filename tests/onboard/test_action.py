"""Action policy: onboard arithmetic."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.policy.action import action_moment, action_moments
from onboard.policy.files import ActionLayer, import_authors_policy
from tests.drawn_examples import examples
from tests.onboard.policies import policies, small_policy
from tests.onboard.test_trigger import states_around


def reference_moments(policy, states):
    """The network in double precision by matrix products, without the limit."""
    values = (np.asarray(states, np.float64) - policy.scaler_mean) / policy.scaler_std
    for number, layer in enumerate(policy.layers, start=1):
        values = values @ layer.weights.astype(float).T + layer.bias
        if number < len(policy.layers):
            values = np.where(values > 0, values, np.expm1(np.minimum(values, 0)))
    return values[:, 0]


@pytest.mark.parametrize("widths", [(3, 1), (3, 7, 1), (3, 10, 10, 1), (3, 4, 32, 2, 5, 1)])
def test_agrees_with_double_precision_for_any_number_of_layers(widths):
    rng = np.random.default_rng(3)
    policy = small_policy()
    layers = []
    for before, after in itertools.pairwise(widths):
        scale = 1e-3 if after == 1 else 1.0
        weights = rng.normal(0, scale / math.sqrt(before), (after, before)).astype(np.float32)
        layers.append(ActionLayer(weights, rng.normal(0, 0.1 * scale, after).astype(np.float32)))
    layers[-1] = ActionLayer(layers[-1].weights, np.full(1, -0.0065, np.float32))
    policy = replace(policy, layers=tuple(layers))
    states = states_around(policy, 500)
    expected = np.clip(reference_moments(policy, states), policy.a_rot_min, policy.a_rot_max)
    np.testing.assert_allclose(action_moments(policy.compiled(), states), expected, atol=1e-8)


def test_flown_policy_agrees_with_double_precision(shared_data):
    policy = import_authors_policy(shared_data / "habas2022/policy/flown_policy.json")
    states = states_around(policy, 2000, spread=1.5)
    expected = np.clip(reference_moments(policy, states), policy.a_rot_min, policy.a_rot_max)
    np.testing.assert_allclose(action_moments(policy.compiled(), states), expected, atol=1e-8)


@given(policy=policies(), cues=st.tuples(*[st.floats(width=32)] * 3))
@settings(max_examples=examples(40))
def test_stays_within_the_limits_whatever_comes(policy, cues):
    assert policy.a_rot_min <= action_moment(policy.compiled(), *cues) <= policy.a_rot_max


def test_limit_is_reached_from_both_sides():
    policy = small_policy()
    compiled = policy.compiled()
    moments = action_moments(compiled, states_around(policy, 5000, spread=20))
    assert moments.min() == policy.a_rot_min
    assert moments.max() == policy.a_rot_max
