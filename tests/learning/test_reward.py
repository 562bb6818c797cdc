"""Rewards of single rollouts, worked out by hand from the paper's equations and from the flown code."""

import math
from typing import Any

import numpy as np
import pytest

from perchhw.learning.errors import LearningInputError
from perchhw.learning.reward import FLOWN, LATER, PAPER, reward, reward_weights
from sim_backend.physics.rollout import ROLLOUT


def _rollout(**values: float) -> Any:
    out = np.zeros(1, ROLLOUT)[0]
    for name, value in values.items():
        out[name] = value
    return out


PERFECT = {
    "triggered": 1,
    "tau": 0.21,
    "d_min": 0.05,
    "contact": 1,
    "impact_tilt": math.radians(125),
    "feet": 4,
}


def test_a_perfect_landing_earns_everything() -> None:
    assert reward(_rollout(**PERFECT), PAPER) == pytest.approx(1.0)
    assert reward(_rollout(**PERFECT), FLOWN) == pytest.approx(1.0)


def test_the_reward_of_the_later_sweeps() -> None:
    """0.1 closeness, 0.3 angle up to 90 deg, legs 0.6, 0.3 with contact, 0.2 on two, 0.1 with both."""
    upright = {**PERFECT, "impact_tilt": math.radians(45)}
    expected = ((4, 0, 0.85), (4, 1, 0.55), (2, 0, 0.45), (2, 1, 0.35), (1, 0, 0.25))
    for feet, contact, total in expected:
        out = _rollout(**{**upright, "feet": feet, "body_contact": contact})
        assert reward(out, LATER) == pytest.approx(total)
    assert reward(_rollout(**PERFECT), LATER) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("change", "paper", "flown"),
    [
        ({"feet": 3}, 1.0, 1.0),
        ({"feet": 2}, 0.35 + 0.65 * 0.5, 0.3 + 0.2),
        ({"feet": 1}, 0.35 + 0.65 * 0.5, 0.3),
        ({"feet": 0}, 0.35, 0.3),
        ({"body_contact": 1}, 0.35 + 0.65 / 3, 0.3 + 0.4),
        ({"feet": 2, "body_contact": 1}, 0.35 + 0.65 * 0.5 / 3, 0.3 + 0.1),
        ({"d_min": 0.2}, 1.0 - 0.05 + 0.05 * 5.0 / 15.0, 0.9 + 0.1 * (1 / 0.201) / 10),
        ({"tau": 0.3}, 1.0 - 0.1 + 0.1 * 10.0 / 15.0, 1.0),
        ({"tau": 0.2}, 1.0, 1.0),
        ({"impact_tilt": math.radians(60)}, 1.0 - 0.2 + 0.1, 1.0 - 0.2 + 0.1),
    ],
)
def test_each_part(change: dict[str, float], paper: float, flown: float) -> None:
    out = _rollout(**{**PERFECT, **change})
    assert reward(out, PAPER) == pytest.approx(paper)
    assert reward(out, FLOWN) == pytest.approx(flown)


def test_no_trigger_and_no_contact_earn_closeness_alone() -> None:
    assert reward(_rollout(d_min=0.5), PAPER) == pytest.approx(0.05 * 2.0 / 15.0)


def test_trigger_part_saturates_where_the_errata_say() -> None:
    """c1 = 15 saturates for tau within 0.133 to 0.267 s."""
    for tau, full in ((0.134, True), (0.266, True), (0.132, False), (0.268, False)):
        part = reward(_rollout(**{**PERFECT, "tau": tau}), PAPER) - 0.9
        assert (part == pytest.approx(0.1)) is full


def test_unknown_preset_is_refused() -> None:
    with pytest.raises(LearningInputError, match="paper, flown"):
        reward_weights("best")
