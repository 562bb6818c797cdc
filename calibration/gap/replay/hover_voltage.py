"""A battery voltage for flights that logged none: that of the model's own battery, at the charge at which the
model carries the vehicle."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from calibration.errors import CalibrationError
from calibration.gap.data.record import FlightRecord, NotUsed
from calibration.gap.data.smoothing import force_from_poses
from calibration.gap.replay.teacher_forcing import teacher_forced
from onboard.arrays import BoolArray, FloatArray
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle
from sim_backend.physics.parameters import physics_parameters

_FAR = 1e3
"""m: a ceiling that no rotor feels."""

_RANGE = 5.0
"""Factor about the full battery's voltage within which a voltage is sought."""


_SEVERAL, _ANOTHER = 4, 0.25
"""Flights from which one is told to be of another vehicle; share of the thrust needed by which it differs."""


class NeverCarriedError(CalibrationError):
    """The model cannot carry the vehicle with these commands at any voltage."""


def of_one_vehicle(
    records: Sequence[FlightRecord], vehicle: Vehicle
) -> tuple[list[FlightRecord], list[NotUsed]]:
    """Flights that the model's thrust carries alike, with a voltage each; and those that it does not.

    A flight that needs another thrust for its commands than most is one of another vehicle, or its commands
    or voltage are in another unit.
    """
    carried, needs, refused = [], [], []
    for record in records:
        try:
            one = with_voltage(record, vehicle)
        except NeverCarriedError as error:
            refused.append(NotUsed(record.name, str(error)))
            continue
        carried.append(one)
        needs.append(thrust_needed(one, vehicle))
    usual = float(np.median(needs)) if len(needs) >= _SEVERAL else np.nan
    alike = [not abs(need / usual - 1.0) > _ANOTHER for need in needs]
    refused += [
        NotUsed(
            one.name,
            f"needs {need / usual:.2f} times the thrust for its commands that most of these flights need: "
            "another vehicle, or commands or voltage in another unit",
        )
        for one, need, same in zip(carried, needs, alike, strict=True)
        if not same
    ]
    return [one for one, same in zip(carried, alike, strict=True) if same], refused


def thrust_needed(record: FlightRecord, vehicle: Vehicle) -> float:
    """Thrust that a flight needed, as a share of what its commands mean to the model; where no voltage was
    measured, with a battery that is half empty."""
    if record.voltage is not None and not record.voltage_measured:
        battery = vehicle.battery
        half_empty = battery.open_circuit_full.value - 0.5 * battery.open_circuit_slope.value
        return float(record.voltage.mean() / half_empty) ** 2
    force, used = _known_force(record)
    if not used.any():
        return 1.0
    predicted = teacher_forced(record, below_no_ceiling(vehicle)).force[used, 2]
    return float(force[used, 2].mean() / predicted.mean())


def with_voltage(record: FlightRecord, vehicle: Vehicle) -> FlightRecord:
    """The record with its measured voltage, or with the one that this vehicle needs.

    Raises:
        NeverCarriedError: it cannot be carried; the message says what the commands amount to.
    """
    measured = record.voltage is not None and record.voltage_measured
    return record if measured else with_hover_voltage(record, vehicle)


def with_hover_voltage(record: FlightRecord, vehicle: Vehicle) -> FlightRecord:
    """The record with a voltage at which the thrusts of its commands make its mean specific force.

    It falls as the model's battery does under these thrusts: a pack empties in every flight, and a constant
    voltage would call that a thrust that fades.

    Raises:
        NeverCarriedError: there is none; the message says what the commands amount to.
    """
    parameters = below_no_ceiling(vehicle)
    force, used = _known_force(record)
    if not used.any():
        raise NeverCarriedError(
            f"{record.source}: no voltage, and no flight with known motor commands to tell it"
        )
    needed = float(force[used, 2].mean())
    full = vehicle.battery.open_circuit_full.value

    def carrying(course: FloatArray) -> FlightRecord:
        """The record with a voltage (V) of this course, shape (n,), all of it shifted."""

        def at(voltage: float) -> FlightRecord:
            return replace(record, voltage=voltage + course, voltage_measured=False)

        def missing(voltage: float) -> float:
            return float(teacher_forced(at(voltage), parameters).force[used, 2].mean()) - needed

        if not missing(full / _RANGE) < 0.0 < missing(full * _RANGE):
            raise NeverCarriedError(
                f"{record.source}: the model does not carry the vehicle with these commands at any voltage "
                f"(mean duty {record.duty[record.flying].mean():.2g} of 1): wrong vehicle, or commands in "
                "another range"
            )
        return at(float(brentq(missing, full / _RANGE, full * _RANGE, xtol=1e-3)))

    steady = carrying(np.zeros(record.t.size))
    return carrying(_course(steady, vehicle, used))


def _course(record: FlightRecord, vehicle: Vehicle, used: BoolArray) -> FloatArray:
    """Voltage (V) of the model's battery along a flight, less its mean where `used`, shape (n,)."""
    battery = vehicle.battery
    drawn = teacher_forced(record, below_no_ceiling(vehicle))
    emptied = battery.open_circuit_slope.value / battery.capacity.value * drawn.charge
    fallen = emptied + battery.resistance.value * drawn.current
    return np.asarray(fallen[used].mean() - fallen)


def _known_force(record: FlightRecord) -> tuple[FloatArray, BoolArray]:
    """Specific force (m/s2, body), shape (n, 3), and where it and the commands are known in flight."""
    force = force_from_poses(record) if record.specific_force is None else record.specific_force
    return force, np.asarray(record.flying & record.motors_known & np.isfinite(force).all(axis=1))


def below_no_ceiling(vehicle: Vehicle) -> Any:
    """Physics parameters far from any ceiling."""
    return physics_parameters(vehicle, RoomGeometry(ceiling_z=_FAR))
