"""What a lab's own day may hold: flights that cannot be judged say why, and do not spoil the others."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration.flights import Flight, flight_files, open_flights
from calibration.gap.landings.outcomes import PreparedLandings, prepare
from onboard.vehicle import load_vehicle
from tests.gap.truth_landings.drone import Drone
from tests.gap.truth_landings.judge import VEHICLE
from tests.gap.truth_landings.outcomes import write_outcomes


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> list[Flight]:
    """Eight flights as a lab would log them."""
    folder: Path = tmp_path_factory.mktemp("day")
    write_outcomes(Drone(), 8, 7, folder / "f", folder / "answer.json")
    flights, _ = open_flights(flight_files([folder / "f"]))
    return flights


def prepared(flights: list[Flight]) -> PreparedLandings:
    return prepare(flights, load_vehicle(VEHICLE), np.random.default_rng(0), 2)


def changed(flight: Flight, change: Callable[[np.ndarray], np.ndarray], *channels: str) -> Flight:
    """A flight with other numbers in some channels."""
    return replace(flight, data={**flight.data, **{name: change(flight.data[name]) for name in channels}})


def test_a_jolt_before_the_trigger_is_no_contact(day: list[Flight]) -> None:
    """A gust in the approach: the flip, whose time begins with the trigger, would have had less than none."""
    flight = day[3]
    assert flight.trigger is not None
    before = (flight.t <= flight.trigger.t) & (flight.t > flight.trigger.t - 0.28)
    pitching = np.where(before, 1.2, flight.data["gy"])
    pitching[np.flatnonzero(before)[8]] = 8.0
    ready = prepared([changed(flight, lambda _: pitching, "gy")])
    assert ready.starts[0].contact is None
    assert ready.contact(0) is None
