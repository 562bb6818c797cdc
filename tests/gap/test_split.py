"""Flights that are kept back leave in the fit whatever only one or two flights show."""

import dataclasses
from functools import cache

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.split import folds, split_flights
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly


@cache
def circling() -> FlightRecord:
    return fly(load_vehicle("crazyflie21-stock"), circle(), 4.0)


def flights(heights: list[float]) -> list[FlightRecord]:
    """The same circle at several heights, each a shape of its own."""
    return [
        dataclasses.replace(
            circling(),
            name=f"f{n}",
            shape=f"s{n}",
            position=circling().position + np.array([0.0, 0.0, height]),
        )
        for n, height in enumerate(heights)
    ]


def test_both_of_two_high_flights_are_fitted_to_wherever_they_stand() -> None:
    for order in ((0, 1), (8, 9), (3, 6)):
        heights = [1.0 if n in order else 0.0 for n in range(10)]
        fit_to, kept_back = split_flights(flights(heights))
        assert set(order) <= set(fit_to)
        assert len(kept_back) == 3


def test_of_many_high_flights_some_are_kept_back() -> None:
    fit_to, kept_back = split_flights(flights([1.0] * 5 + [0.0] * 5))
    assert len(kept_back) == 3
    assert sum(n < 5 for n in fit_to) >= 2


def test_no_flight_is_kept_back_twice() -> None:
    for kinds in ([0, 0, 1, 1, 1, 1, 2, 2, 3, 3], [0, 1, 1, 2, 2, 2, 2, 2, 2, 2]):
        records = [
            dataclasses.replace(circling(), name=f"f{n}", shape=f"s{kind}") for n, kind in enumerate(kinds)
        ]
        fit_to, kept_back = split_flights(records)
        assert sorted([*fit_to, *kept_back]) == list(range(10))


def test_a_kind_that_most_flights_are_of_is_spread_over_the_folds() -> None:
    records = [dataclasses.replace(circling(), shape="one" if n < 6 else f"s{n}") for n in range(8)]
    assert len(set(folds(records)[:6].tolist())) > 2
