"""The policy `pads`, trained where slow feet do not stick, beside the default one."""

import numpy as np
import pytest

from onboard.policy.files import load_policy, shipped_policy_path
from perchhw.learning.grid import conditions
from perchhw.learning.setup import LearningSetup
from perchhw.learning.validate import validate_policy

GRID = conditions((1.85, 2.15, 2.45, 2.75), (34.0, 49.0, 64.0, 79.0))
"""Between the conditions of the sweep that it learned from."""


def rate(policy: str, setup: LearningSetup) -> tuple[float, float]:
    """Any four legs, and four without contact, over the grid."""
    rows = validate_policy(load_policy(shipped_policy_path(policy)), setup, GRID, rollouts=40)
    any_four, clean = (np.mean([row[name] for row in rows]) for name in ("four_leg_rate", "landing_rate"))
    return float(any_four), float(clean)


@pytest.fixture(scope="module")
def truer() -> LearningSetup:
    return LearningSetup(vehicle="crazyflie21-upgraded", domain="none", sensing="realistic", seed=5)


def test_it_lands_more_often_than_the_default_where_slow_feet_do_not_stick(truer: LearningSetup) -> None:
    """0.41 against 0.29 over all conditions (docs/learning.md); 640 landings: standard error 0.02."""
    any_four, clean = np.subtract(rate("pads", truer), rate("default", truer))
    assert any_four > 0.05
    assert clean > 0.03
