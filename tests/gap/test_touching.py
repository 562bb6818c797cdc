"""What touches the floor does not fly: by the size and the lean of the vehicle, where nothing stood first."""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.gap.data.phases import CONTACT_MARGIN_S
from calibration.gap.data.record import FlightRecord
from calibration.gap.replay.touching import clear_of_floor
from onboard.vehicle import load_vehicle
from tests.gap.simulated_flight import circle, fly

STOCK = load_vehicle("crazyflie21-stock")
HULL = -STOCK.body.body_bottom_z.value
LOW = HULL + 0.015
"""m: a level vehicle is clear of the floor."""


@functools.cache
def flown() -> FlightRecord:
    return fly(STOCK, circle(), 3.0)


def low(lean_deg: float, height: float = LOW) -> FlightRecord:
    """A flight that is `height` above the floor for a moment in its middle, and leans there."""
    record = flown()
    position, attitude = record.position.copy(), record.attitude.copy()
    moment = np.abs(record.t - 1.5) < 0.05
    position[moment, 2] = height
    attitude[moment] = Rotation.from_euler("x", lean_deg, degrees=True).as_quat()
    return dataclasses.replace(record, position=position, attitude=attitude)


@pytest.mark.parametrize(("lean", "touches"), [(0.0, False), (25.0, True)])
def test_a_vehicle_that_leans_touches_the_floor_earlier(lean: float, touches: bool) -> None:
    record = low(lean)
    (clear,) = clear_of_floor([record], STOCK)
    lost = record.t[record.flying & ~clear.flying]
    assert bool(lost.size) is touches
    if touches:
        assert lost[-1] - lost[0] == pytest.approx(0.1 + 2.0 * CONTACT_MARGIN_S, abs=3.0 * record.dt)


def test_what_stood_first_or_counts_its_height_from_elsewhere_stays_as_it_is() -> None:
    stood = dataclasses.replace(low(25.0), resting=flown().t < 0.1)
    elsewhere = dataclasses.replace(flown(), position=flown().position - [0.0, 0.0, 5.0])
    for record in (stood, elsewhere):
        assert np.array_equal(clear_of_floor([record], STOCK)[0].flying, record.flying)
