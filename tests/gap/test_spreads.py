"""How much nuisances differ between flights is found from wherever the search for it begins."""

import numpy as np
import pytest

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.mixed import FIRST_SPREAD, Prior, Products, fit_mixed
from calibration.gap.estimate.nuisances import NUISANCES, SPREADS, STEADY

FLIGHTS, TRIM = 16, [n.name for n in NUISANCES].index("torque_trim_y")
OF_FLIGHTS = len(NUISANCES) + STEADY.index(TRIM)
NONE = Prior.independent(np.zeros(0), np.zeros(0))


def trims(levels: np.ndarray, error: float) -> Products:
    """Products of flights each part of which tells its trim (rad/s2) to `error`; no effect."""
    told = np.repeat(levels, PARTS)
    q, parts = len(NUISANCES), told.size
    zz, zr = np.zeros((parts, q, q)), np.zeros((parts, q))
    zz[:, TRIM, TRIM] = error**-2.0
    zr[:, TRIM] = told * error**-2.0
    nothing = np.zeros((parts, q, 0)), np.zeros((parts, 0, 0)), np.zeros((parts, 0))
    return Products(
        zz=zz, zx=nothing[0], xx=nothing[1], zr=zr, xr=nothing[2], rr=told**2 * error**-2.0,
        constant=np.zeros(parts),
    )  # fmt: skip


def test_trims_that_flights_tell_badly_are_known_to_differ_by_far_more_than_was_assumed() -> None:
    """Each flight tells its trim to 5 rad/s2, ten times what is assumed; they differ by 10.

    Expectation-maximisation is at 3.5 after 40 rounds."""
    drawn = np.random.default_rng(1).normal(size=FLIGHTS)
    levels = 10.0 * (drawn - drawn.mean()) / drawn.std(ddof=1)
    fit = fit_mixed(trims(levels, 10.0), NONE)
    assert fit.settled
    assert fit.spread[OF_FLIGHTS] == pytest.approx(np.sqrt(10.0**2 - 5.0**2), rel=0.1)


def test_where_the_search_begins_makes_no_difference() -> None:
    levels = 4.0 * np.random.default_rng(2).normal(size=FLIGHTS)
    p = trims(levels, 2.0)
    low, high = np.array([s.least for s in SPREADS]), np.array([s.most for s in SPREADS])
    found = [fit_mixed(p, NONE, start) for start in (FIRST_SPREAD, low, high)]
    assert all(fit.settled for fit in found)
    ends = np.array([fit.spread[OF_FLIGHTS] for fit in found])
    assert ends == pytest.approx(ends.mean(), rel=0.02)


def test_spreads_of_which_flights_say_nothing_stay_where_they_were() -> None:
    fit = fit_mixed(trims(np.zeros(FLIGHTS), 2.0), NONE)
    others = [i for i in range(len(SPREADS)) if i not in (TRIM, OF_FLIGHTS)]
    assert fit.settled
    assert fit.spread[others] == pytest.approx(FIRST_SPREAD[others])


def test_a_search_without_an_end_is_said_not_to_have_settled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("calibration.gap.estimate.spreads._MOST_STEPS", 2)
    assert not fit_mixed(trims(10.0 * np.random.default_rng(3).normal(size=FLIGHTS), 1.0), NONE).settled
