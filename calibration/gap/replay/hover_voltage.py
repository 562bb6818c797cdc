"""A battery voltage for flights that logged none: the one at which the model carries the vehicle."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from calibration.errors import CalibrationError
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.smoothing import force_from_poses
from calibration.gap.replay.teacher_forcing import teacher_forced
from onboard.room import RoomGeometry
from onboard.vehicle import Vehicle
from sim_backend.physics.parameters import physics_parameters

_FAR = 1e3
"""m: a ceiling that no rotor feels."""

_RANGE = 5.0
"""Factor about the full battery's voltage within which a voltage is sought."""


class NeverCarriedError(CalibrationError):
    """The model cannot carry the vehicle with these commands at any voltage."""


def voltage_for(records: Sequence[FlightRecord], vehicle: Vehicle) -> list[FlightRecord]:
    """The records, those without a measured voltage with the one that this vehicle needs.

    Raises:
        NeverCarriedError: one of them cannot be carried; the message names it.
    """
    return [
        record
        if record.voltage is not None and record.voltage_measured
        else with_hover_voltage(record, vehicle)
        for record in records
    ]


def with_hover_voltage(record: FlightRecord, vehicle: Vehicle) -> FlightRecord:
    """The record with the constant voltage at which the thrusts of its commands make its mean specific force.

    Raises:
        NeverCarriedError: there is none; the message says what the commands amount to.
    """
    parameters = physics_parameters(vehicle, RoomGeometry(ceiling_z=_FAR))
    force = force_from_poses(record) if record.specific_force is None else record.specific_force
    used = record.flying & record.motors_known & np.isfinite(force).all(axis=1)
    needed = float(force[used, 2].mean()) if used.any() else np.nan
    full = vehicle.battery.open_circuit_full.value

    def at(voltage: float) -> FlightRecord:
        return replace(record, voltage=np.full(record.t.size, voltage), voltage_measured=False)

    def missing(voltage: float) -> float:
        return float(teacher_forced(at(voltage), parameters).force[used, 2].mean()) - needed

    if not used.any() or not missing(full / _RANGE) < 0.0 < missing(full * _RANGE):
        raise NeverCarriedError(
            f"{record.source}: the model does not carry the vehicle with these commands at any voltage (mean "
            f"duty {record.duty[record.flying].mean():.2g} of 1): wrong vehicle, or commands in another range"
        )
    return at(float(brentq(missing, full / _RANGE, full * _RANGE, xtol=1e-3)))
