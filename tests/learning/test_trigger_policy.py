"""Training of the trigger policy, against the one that flew."""

import numpy as np
import pytest

from onboard.policy.files import import_authors_policy, make_policy
from onboard.policy.trigger import trigger_values
from perchhw.learning.training_set import load_training_set
from perchhw.learning.trigger_policy import TrainingError, fit_scaler, fit_trigger


@pytest.fixture(scope="module")
def flown(shared_data):
    return import_authors_policy(shared_data / "habas2022/policy/flown_policy.json")


@pytest.fixture(scope="module")
def pairs(shared_data):
    return load_training_set(shared_data / "habas2022/policy/training_set_NL.csv")


def test_scaler_is_the_flown_one_to_four_digits(flown, pairs):
    scaler = fit_scaler(pairs.states)
    np.testing.assert_allclose(scaler.mean, flown.scaler_mean, rtol=5e-5)
    # The flown file has five decimals: 0.01350 is known to 4e-4.
    np.testing.assert_allclose(scaler.std, flown.scaler_std, rtol=5e-5, atol=5e-6)


def test_trigger_is_the_flown_one(flown, pairs):
    scaler = fit_scaler(pairs.states)
    fit = fit_trigger(scaler.transform(pairs.states))
    assert len(fit.dual_coefficients) == len(flown.dual_coefficients)
    assert fit.intercept == pytest.approx(float(flown.intercept), abs=1e-4)
    ours = make_policy(
        name="ours",
        scaler_mean=scaler.mean,
        scaler_std=scaler.std,
        support_vectors=fit.support_vectors,
        dual_coefficients=fit.dual_coefficients,
        gamma=2.0,
        intercept=fit.intercept,
        layers=flown.layers,
        provenance={},
    )
    rng = np.random.default_rng(4)
    spread = rng.uniform(-2.5, 2.5, (20_000, 3))
    states = (flown.scaler_mean + flown.scaler_std * spread).astype(np.float32)
    theirs = trigger_values(flown.compiled(), states)
    assert np.count_nonzero(theirs >= 0) > 1000
    np.testing.assert_allclose(trigger_values(ours.compiled(), states), theirs, atol=2e-3)
    assert ours.tau_min == pytest.approx(flown.tau_min, abs=2e-4)
    assert ours.tau_max == pytest.approx(flown.tau_max, abs=2e-4)


def test_onboard_arithmetic_agrees_with_the_training_library(pairs):
    from sklearn.svm import OneClassSVM

    scaler = fit_scaler(pairs.states)
    scaled = scaler.transform(pairs.states)
    machine = OneClassSVM(kernel="rbf", gamma=2.0, nu=0.1).fit(scaled)
    fit = fit_trigger(scaled)
    distance = ((scaled[:, None] - fit.support_vectors) ** 2).sum(axis=2)
    values = np.exp(-2.0 * distance) @ fit.dual_coefficients + fit.intercept
    np.testing.assert_allclose(values, machine.decision_function(scaled), atol=1e-9)


def test_nu_bounds_the_share_outside():
    scaled = np.random.default_rng(5).normal(size=(200, 3))
    tight, wide = (fit_trigger(scaled, gamma=0.1, nu=nu) for nu in (0.3, 0.05))
    assert tight.inside_share == pytest.approx(0.7, abs=0.05)
    assert wide.inside_share == pytest.approx(0.95, abs=0.03)


def test_pairs_that_do_not_vary_are_refused():
    with pytest.raises(TrainingError, match="do not vary"):
        fit_scaler(np.ones((5, 3)))
