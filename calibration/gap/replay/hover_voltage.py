"""A battery voltage for flights that logged none: the one at which the model carries the vehicle.

It falls as the model's battery does under these thrusts, or not at all (a controller that compensates for it,
a supply on a cable), whichever the flights' forces speak for beside a drag and a wind.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from calibration.errors import CalibrationError
from calibration.gap.data.record import FlightRecord, NotUsed
from calibration.gap.data.rotations import matrices
from calibration.gap.data.smoothing import force_from_poses
from calibration.gap.replay.inputs import below_no_ceiling
from calibration.gap.replay.teacher_forcing import teacher_forced
from onboard.arrays import BoolArray, FloatArray
from onboard.vehicle import Vehicle

_RANGE = 5.0
"""Factor about the full battery's voltage within which a voltage is sought."""


_SEVERAL, _ANOTHER = 4, 0.25
"""Flights from which one is told to be of another vehicle; share of the thrust needed by which it differs."""


def of_one_vehicle(
    records: Sequence[FlightRecord], vehicle: Vehicle
) -> tuple[list[FlightRecord], list[NotUsed]]:
    """Flights that the model's thrust carries alike, with a voltage each; and those that it does not.

    A flight that needs another thrust for its commands than most is one of another vehicle, or its commands
    or voltage are in another unit.
    """
    carried, never = with_voltages(records, vehicle)
    refused = [NotUsed(record.name, reason) for record, reason in never]
    needs = [thrust_needed(one, vehicle) for one in carried]
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


class Unpredicted(NamedTuple):
    """A flight of which nothing can be predicted, and why."""

    record: FlightRecord
    reason: str


def with_voltages(
    records: Sequence[FlightRecord], vehicle: Vehicle
) -> tuple[list[FlightRecord], list[Unpredicted]]:
    """The records with a voltage each, measured or made, and those that the model carries at none.

    A pack empties in every flight, and a constant voltage would call that a thrust that fades; but one that
    does not sag where the model's does would be a thrust that grows.
    """
    carried: list[FlightRecord] = []
    never: list[Unpredicted] = []
    made: list[tuple[FlightRecord, FlightRecord]] = []
    for record in records:
        if record.voltage is not None and record.voltage_measured:
            carried.append(record)
            continue
        try:
            steady = _carrying(record, vehicle, np.zeros(record.t.size))
            made.append((steady, _carrying(record, vehicle, _course(steady, vehicle))))
        except _NoVoltageError as error:
            never.append(Unpredicted(record, str(error)))
            continue
        carried.append(steady)
    steady_ones, falling_ones = ([pair[index] for pair in made] for index in (0, 1))
    falls = bool(made) and _missed(falling_ones, vehicle) < _missed(steady_ones, vehicle)
    falling = {id(steady): other for steady, other in made if falls}
    return [falling.get(id(record), record) for record in carried], never


class _NoVoltageError(CalibrationError):
    """The model cannot carry the vehicle with these commands at any voltage."""


def _carrying(record: FlightRecord, vehicle: Vehicle, course: FloatArray) -> FlightRecord:
    """The record with a voltage of this `course` (V, shape (n,)), all of it shifted until the thrusts of
    its commands make its mean specific force.

    Raises:
        _NoVoltageError: there is none; the message says what the commands amount to.
    """
    parameters = below_no_ceiling(vehicle)
    force, used = _known_force(record)
    if not used.any():
        raise _NoVoltageError(
            f"{record.source}: no voltage, and no flight with known motor commands to tell it"
        )
    needed = float(force[used, 2].mean())
    full = vehicle.battery.open_circuit_full.value

    def at(voltage: float) -> FlightRecord:
        return replace(record, voltage=voltage + course, voltage_measured=False)

    def missing(voltage: float) -> float:
        return float(teacher_forced(at(voltage), parameters).force[used, 2].mean()) - needed

    if not missing(full / _RANGE) < 0.0 < missing(full * _RANGE):
        raise _NoVoltageError(
            f"{record.source}: the model does not carry the vehicle with these commands at any voltage (mean "
            f"duty {record.duty[record.flying].mean():.2g} of 1): wrong vehicle, or commands in another range"
        )
    return at(float(brentq(missing, full / _RANGE, full * _RANGE, xtol=1e-3)))


def _missed(records: Sequence[FlightRecord], vehicle: Vehicle) -> float:
    """Squares of the force along the thrust that neither the model nor the air makes (m2/s4), summed.

    A drag in a steady wind pulls along the thrust as the vehicle moves along it and as it leans: where no
    file says so, by more than a voltage that falls changes, which then fitted the drag (six flights in 1.8
    m/s, without a battery: 58 m2/s4 for a voltage that falls, 370 against it beside a drag and a wind). One
    drag and one wind are fitted to all flights: of one for each, few short flights leave nothing to tell.
    """
    table = np.vstack([_unmade(record, vehicle) for record in records])
    missing, air = table[:, 0], table[:, 1:]
    left = missing - air @ np.linalg.lstsq(air, missing, rcond=None)[0]
    return float(left @ left)


def _unmade(record: FlightRecord, vehicle: Vehicle) -> FloatArray:
    """Force along the thrust that the model does not make (m/s2), and what a drag (velocity along it, m/s)
    and a wind (its direction in the world, x and y) would add to it, each less its mean, shape (n, 4)."""
    force, used = _known_force(record)
    missing = (force - teacher_forced(record, below_no_ceiling(vehicle)).force)[used, 2]
    thrust = matrices(record.attitude)[used, :, 2]
    along = np.einsum("nj,nj->n", record.velocity[used], thrust)
    table = np.column_stack([missing, along, thrust[:, :2]])
    return np.asarray(table - table.mean(axis=0))


def _course(record: FlightRecord, vehicle: Vehicle) -> FloatArray:
    """Voltage (V) of the model's battery along a flight, less its mean where it is known, shape (n,)."""
    battery, used = vehicle.battery, _known_force(record)[1]
    drawn = teacher_forced(record, below_no_ceiling(vehicle))
    emptied = battery.open_circuit_slope.value / battery.capacity.value * drawn.charge
    fallen = emptied + battery.resistance.value * drawn.current
    return np.asarray(fallen[used].mean() - fallen)


def _known_force(record: FlightRecord) -> tuple[FloatArray, BoolArray]:
    """Specific force (m/s2, body), shape (n, 3), and where it and the commands are known in flight."""
    force = force_from_poses(record) if record.specific_force is None else record.specific_force
    return force, np.asarray(record.flying & record.motors_known & np.isfinite(force).all(axis=1))
