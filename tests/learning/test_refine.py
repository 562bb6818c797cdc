"""The refinement of the action policy on where the trigger fires."""

import numpy as np
import pytest

from onboard.policy.files import load_policy, shipped_policy_path
from onboard.policy.model import CompiledPolicy
from perchhw.attempt import STORED_VEHICLE
from perchhw.learning.executor import LocalThreads
from perchhw.learning.grid import conditions
from perchhw.learning.refine import (
    RefinementSettings,
    middle_of_landing_range,
    refine_action,
    with_constant_moment,
)
from perchhw.learning.setup import LearningSetup
from perchhw.learning.trigger_policy import TrainingError
from perchhw.learning.validate import validate_policy

GRID = tuple(conditions((2.0, 2.5, 3.0), (35.0, 50.0)))
SETUP = LearningSetup(vehicle=STORED_VEHICLE, sensing="realistic")


def _mean_rate(policy: object) -> float:
    rows = validate_policy(policy, SETUP, GRID, rollouts=30)  # type: ignore[arg-type]
    return float(np.mean([float(row["landing_rate"] or 0.0) for row in rows]))


def test_the_middle_is_that_of_the_neighbours_of_the_best() -> None:
    moments = -np.linspace(1e-3, 7e-3, 7)
    rates = np.array([1.0, 0.0, 0.0, 0.9, 1.0, 0.9, 0.1])
    assert middle_of_landing_range(moments, rates, 0.7) == pytest.approx(-5e-3)


@pytest.mark.further
def test_a_spoilt_action_lands_again_after_the_refinement() -> None:
    policy = load_policy(shipped_policy_path())
    spoilt = with_constant_moment(policy, -2e-3)
    before, shipped = _mean_rate(spoilt), _mean_rate(policy)
    refined = refine_action(spoilt, SETUP, GRID)
    assert before < 0.3 < 0.7 < shipped
    assert _mean_rate(refined) >= shipped - 0.1
    # The trigger is another's business: not a number of it has changed.
    kept: CompiledPolicy = policy.compiled()
    np.testing.assert_array_equal(refined.compiled().support_vectors, kept.support_vectors)
    assert refined.intercept == policy.intercept


@pytest.mark.soak
def test_the_workers_do_not_change_the_refinement() -> None:
    policy = load_policy(shipped_policy_path())
    few = RefinementSettings(steps=6, rollouts=6)
    one = refine_action(policy, SETUP, GRID, settings=few, executor=LocalThreads(1))
    three = refine_action(policy, SETUP, GRID, settings=few, executor=LocalThreads(3))
    for a, b in zip(one.layers, three.layers, strict=True):
        np.testing.assert_array_equal(a.weights, b.weights)


def test_a_trigger_that_never_lands_teaches_nothing() -> None:
    policy = load_policy(shipped_policy_path())
    weak = RefinementSettings(weakest=-1e-4, strongest=-2e-4, steps=3, rollouts=4)
    with pytest.raises(TrainingError, match="wider grid"):
        refine_action(policy, SETUP, GRID, settings=weak)
