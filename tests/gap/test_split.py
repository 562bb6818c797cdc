"""Flights that are kept back leave in the fit whatever only one or two flights show."""

import dataclasses
from functools import cache

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.split import split_flights
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
