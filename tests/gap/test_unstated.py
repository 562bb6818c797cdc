"""What no vehicle file states does not pass for a name."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibration.gap.data import differentiate
from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, refine, training_set
from calibration.gap.estimate.unstated import AXES
from calibration.gap.search.always import LOG_TIMING
from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle, load_vehicle
from tests.gap.simulated_flight import circle, fly, up_and_down

STOCK = load_vehicle("crazyflie21-stock")
BOARD = np.array([0.003, -0.002, 0.004])
"""m, of the accelerometer from the middle."""

CENTRE = {"x": -0.003, "y": 0.002, "z": 0.0}
OFFSET = tuple(Variable("com_offset", axis) for axis in CENTRE)


def flights(vehicle: Vehicle) -> list[FlightRecord]:
    return [fly(vehicle, circle(), 8.0), fly(vehicle, up_and_down(), 8.0)]


def with_board(record: FlightRecord, place: np.ndarray) -> FlightRecord:
    """The flight as an accelerometer felt it that sits at `place` (m) instead of the middle."""
    turn_up = np.gradient(record.rate, record.dt, axis=0)
    beside = np.cross(turn_up, place) + np.cross(record.rate, np.cross(record.rate, place))
    assert record.specific_force is not None
    return dataclasses.replace(record, specific_force=record.specific_force + beside)


def tracked_at(record: FlightRecord, place: np.ndarray) -> FlightRecord:
    """The flight without an accelerometer, as motion capture sees a point at `place` (m) on the vehicle."""
    position = record.position + Rotation.from_quat(record.attitude).apply(place)
    return dataclasses.replace(
        record, position=position, velocity=differentiate(position, record.dt), specific_force=None
    )


def fitted(records: list[FlightRecord], *variables: Variable) -> Fitted:
    model = Model(STOCK)
    return refine(model, (LOG_TIMING, *variables), training_set(records, model))


def place_of_board(fit: Fitted) -> np.ndarray:
    first, arm = len(fit.variables), fit.model.size.arm
    return np.asarray(0.1 * arm * fit.estimate.fit.theta[first : first + AXES])


def test_a_board_beside_the_middle_is_no_centre_of_mass() -> None:
    """Torques say where the thrust acts, whatever the accelerometer feels."""
    fit = fitted([with_board(record, BOARD) for record in flights(STOCK)], *OFFSET)
    np.testing.assert_allclose(place_of_board(fit)[:2], BOARD[:2], atol=5e-4)
    found = np.array([fit.model.values[v] for v in OFFSET])
    np.testing.assert_allclose(found[:2], 0.0, atol=3e-4)


def test_a_tracked_point_beside_the_middle_is_no_centre_of_mass_without_an_accelerometer() -> None:
    fit = fitted([tracked_at(record, BOARD) for record in flights(STOCK)], *OFFSET)
    np.testing.assert_allclose(place_of_board(fit)[:2], BOARD[:2], atol=1e-3)
    found = np.array([fit.model.values[v] for v in OFFSET])
    np.testing.assert_allclose(found[:2], 0.0, atol=3e-4)


def test_a_centre_of_mass_beside_the_middle_leaves_the_board_there() -> None:
    parameters = {axis: Quantity(value, "m", 0.0, "test") for axis, value in CENTRE.items()}
    heavy = dataclasses.replace(STOCK, effects=(Effect(name="com_offset", parameters=parameters),))
    fit = fitted(flights(heavy), *OFFSET)
    found = {v.parameter: fit.model.values[v] for v in OFFSET[:2]}
    assert found == pytest.approx({axis: CENTRE[axis] for axis in found}, abs=3e-4)
    np.testing.assert_allclose(place_of_board(fit)[:2], 0.0, atol=5e-4)
