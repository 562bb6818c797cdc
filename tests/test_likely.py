"""The question that tests of landings ask: is the count likely under the prediction?"""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from tests.likely import LEVEL, assert_likely, tail


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=7), st.data())
def test_the_tail_is_that_of_all_ways_to_land(p: list[float], data: st.DataObject) -> None:
    happened = data.draw(st.integers(0, len(p)))
    ways = {
        way: np.prod([q if landed else 1.0 - q for q, landed in zip(p, way, strict=True)])
        for way in product((0, 1), repeat=len(p))
    }
    below = sum(share for way, share in ways.items() if sum(way) <= happened)
    above = sum(share for way, share in ways.items() if sum(way) >= happened)
    assert tail(happened, p) == pytest.approx(min(1.0, 2.0 * min(below, above)), abs=1e-12)


def test_equal_probabilities_are_a_binomial() -> None:
    assert tail(3, [0.8] * 20) == pytest.approx(2.0 * binom.cdf(3, 20, 0.8))
    assert tail(20, [0.8] * 20) == pytest.approx(2.0 * 0.8**20)


def test_a_right_prediction_fails_no_oftener_than_the_level_and_a_kind_one_mostly() -> None:
    p = np.linspace(0.3, 0.95, 30)
    rng = np.random.default_rng(2)
    counts = (rng.random((4000, 30)) < p).sum(axis=1)
    assert np.mean([tail(int(count), p.tolist()) < LEVEL for count in counts]) < 3.0 * LEVEL
    fewer = (rng.random((1000, 30)) < 0.4 * p).sum(axis=1)
    assert np.mean([tail(int(count), p.tolist()) < LEVEL for count in fewer]) > 0.8


def test_what_400_simulations_never_saw_may_happen_once_and_not_always() -> None:
    assert_likely(4, [1.0] * 5, simulated=400)
    with pytest.raises(AssertionError, match=r"1 of 5, expected 5\.0"):
        assert_likely(1, [1.0] * 5, simulated=400)
    assert_likely(0, [0.0] * 5, simulated=400)
