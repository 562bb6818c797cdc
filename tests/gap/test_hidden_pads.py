"""Pads hidden by the independent landings, judged by the search over outcomes."""

from itertools import product

import numpy as np
import pytest

from calibration.gap.landings.outcomes.vehicles import HINGES, Point, grid
from tests.gap.truth_landings.drone import Drone
from tests.gap.truth_landings.judge import HEALTHY, Judged, drawn, judge
from tests.gap.truth_landings.judge import HINGES as DAMPED
from tests.gap.truth_landings.outcomes import attempts, land

PADS = Drone(stiffness=DAMPED.stiffness, damping=DAMPED.damping, capture=0.9, capture_spread=0.2)


def test_a_foot_that_comes_slowly_is_refused_and_leaves() -> None:
    """Above every speed that occurs nothing sticks; at none all is as without a limit, to the last bit."""
    attempt = attempts(1, 4)[0]
    deaf = land(Drone(capture=50.0), attempt, 4, 0)
    assert deaf.feet == 0
    assert deaf.log["z"][-1] < attempt.ceiling - 0.2
    without, with_none = land(HEALTHY, attempt, 4, 0), land(Drone(capture=-50.0), attempt, 4, 0)
    assert without.feet >= 3
    np.testing.assert_array_equal(without.log["gy"], with_none.log["gy"])


@pytest.fixture(scope="module")
def few() -> list[Judged]:
    """Eight landings, and a grid of two hinges."""
    pads = [(0.0, 0.0), *product((0.3, 0.6, 0.9, 1.2), (0.2,))]
    points = [Point(*hinge, *pad, 1.0) for hinge, pad in product(HINGES[:3:2], pads)]
    return judge([HEALTHY, PADS], 8, 1, points, 40)


def test_nothing_is_named_where_nothing_is_hidden(few: list[Judged]) -> None:
    assert few[0].named == ()


def test_hidden_pads_are_named_with_their_speed(few: list[Judged]) -> None:
    assert few[1].counts[1] > few[0].counts[1]
    assert "pads" in few[1].named
    _, low, high = few[1].speed
    assert low <= PADS.capture <= high


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_thirty_landings_name_drawn_pads() -> None:
    """docs/gap_landings.md has the figures of more seeds."""
    claims, named, inside = 0, 0, 0
    for seed in range(21, 24):
        healthy, _, *pads = judge(drawn(seed, 4), 30, seed, grid(), 100)
        claims += bool(healthy.named)
        for one in pads:
            if "pads" in one.named:
                named += 1
                _, low, high = one.speed
                inside += low <= one.hidden.capture <= high
    assert claims == 0
    assert named >= 9
    assert inside > named / 2
