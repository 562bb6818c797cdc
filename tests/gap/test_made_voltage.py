"""Without a logged voltage, one is made that empties as the pack of the vehicle file does."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest

from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.replay import evaluate
from calibration.gap.replay.hover_voltage import with_voltages
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle, load_vehicle
from tests.gap.mujoco_flights import flights, frame
from tests.gap.simulated_flight import circle, fly, up_and_down, with_noise
from tests.truth.airframe import nominal
from tests.truth.mujoco_room import Hidden


@pytest.fixture(scope="module")
def flown() -> tuple[FlightRecord, ...]:
    """Flights of a healthy vehicle in MuJoCo, with the voltage of its pack."""
    return flights(Hidden())


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return nominal(frame(), "healthy")


def without(record: FlightRecord) -> FlightRecord:
    return dataclasses.replace(record, voltage=None)


def measured(record: FlightRecord) -> FloatArray:
    assert record.voltage is not None
    return record.voltage


@pytest.mark.further
def test_it_is_what_was_measured(flown: Sequence[FlightRecord], vehicle: Vehicle) -> None:
    for flight in evaluate([without(record) for record in flown], vehicle).flights:
        (record,) = (one for one in flown if one.name == flight.record.name)
        assert not flight.record.voltage_measured
        made, volts = (measured(one)[record.flying] for one in (flight.record, record))
        assert made.mean() == pytest.approx(volts.mean(), rel=0.03)
        assert np.corrcoef(made, volts)[0, 1] > 0.8


def test_it_predicts_better_than_a_constant_one(flown: Sequence[FlightRecord], vehicle: Vehicle) -> None:
    blind = evaluate([without(record) for record in flown], vehicle)
    constant = [
        dataclasses.replace(one.record, voltage=np.full_like(one.record.t, measured(one.record).mean()))
        for one in blind.flights
    ]
    told = [dataclasses.replace(record, voltage_measured=True) for record in constant]
    made, flat = (errors.overall.given_attitude[1.0] for errors in (blind, evaluate(told, vehicle)))
    assert made.position_m < 0.5 * flat.position_m


def test_a_supply_that_does_not_sag_stays_constant() -> None:
    stock, rng = load_vehicle("crazyflie21-stock"), np.random.default_rng(2)
    for sag in (0.0, 0.4):
        records = [with_noise(fly(stock, up_and_down(period=p), 20.0, sag=sag), 0.5, rng) for p in (2.0, 2.5)]
        made, _ = with_voltages([without(record) for record in records], stock)
        assert all((np.ptp(measured(one)) == 0.0) == (sag == 0.0) for one in made)


@pytest.mark.parametrize("wind", [0.0, 1.5])
@pytest.mark.parametrize("sag", [0.0, 0.4])
def test_a_drag_that_no_file_states_does_not_say_whether_a_voltage_falls(wind: float, sag: float) -> None:
    stock, rng = load_vehicle("crazyflie21-stock"), np.random.default_rng(2)
    air = {Variable("linear_drag", axis): 0.02 for axis in "xyz"} | {Variable("wind", "x"): wind}
    truth = Model(stock, air).vehicle()
    paths = (circle(radius=1.0, period=3.0), up_and_down(period=2.0), up_and_down(period=2.5))
    flown = [with_noise(fly(truth, path, 20.0, sag=sag, believed=stock), 0.5, rng) for path in paths]
    made, _ = with_voltages([without(record) for record in flown], stock)
    assert all((np.ptp(measured(one)) == 0.0) == (sag == 0.0) for one in made)


def test_a_vehicle_that_needs_another_voltage_is_doubted(
    flown: Sequence[FlightRecord], vehicle: Vehicle
) -> None:
    mass = dataclasses.replace(vehicle.body.mass, value=2.0 * vehicle.body.mass.value)
    heavy = dataclasses.replace(vehicle, body=dataclasses.replace(vehicle.body, mass=mass))
    (doubt,) = evaluate([without(record) for record in flown], heavy).doubts()
    assert "is this the vehicle that flew?" in doubt
    assert not list(evaluate([without(record) for record in flown], vehicle).doubts())
