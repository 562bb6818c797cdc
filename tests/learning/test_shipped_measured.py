"""The policy `measured`, learned as real approaches scatter, beside the one learned with realistic cues."""

import numpy as np

from onboard.policy.files import load_policy, shipped_policy_path
from perchhw.learning.grid import conditions
from perchhw.learning.setup import MEASURED, LearningSetup
from perchhw.learning.validate import validate_policy

GRID = conditions((1.85, 2.15, 2.45, 2.75, 3.05, 3.35), (34.0, 49.0, 64.0, 79.0))


def test_it_lands_more_often_than_pads_as_real_approaches_scatter() -> None:
    """By 0.1 or more on any four legs over all conditions (docs/learning.md); 960 landings each: one standard
    error of the difference is 0.02."""
    world = LearningSetup(domain="none", sensing=MEASURED, seed=5)
    measured, pads = (
        np.mean(
            [
                row["four_leg_rate"]
                for row in validate_policy(load_policy(shipped_policy_path(name)), world, GRID, rollouts=40)
            ]
        )
        for name in ("measured", "pads")
    )
    assert measured > pads + 0.05
