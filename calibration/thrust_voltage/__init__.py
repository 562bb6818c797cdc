"""Thrust against motor voltage: tables, forms, their choice, battery compensation.

:func:`read_table` and :func:`analyse` are the whole way from a file to a :class:`ThrustResult`;
docs/bench_thrust.md tells the physics. Everything here is pure: files in, numbers and findings out.
"""

from calibration.thrust_voltage.analysis import analyse, questions, read_table
from calibration.thrust_voltage.compensation import (
    Discharge,
    Verification,
    achievable,
    read_discharge,
    verify,
)
from calibration.thrust_voltage.data import ThrustData
from calibration.thrust_voltage.errors import ThrustTableError
from calibration.thrust_voltage.pwm import applied_duty, exact_set_points
from calibration.thrust_voltage.raw_table import RawTable, to_data, write_raw
from calibration.thrust_voltage.result import ThrustResult, VehicleThrust, imported_json, vehicle_thrust
from calibration.thrust_voltage.units import Units

__all__ = [
    "Discharge",
    "RawTable",
    "ThrustData",
    "ThrustResult",
    "ThrustTableError",
    "Units",
    "VehicleThrust",
    "Verification",
    "achievable",
    "analyse",
    "applied_duty",
    "exact_set_points",
    "imported_json",
    "questions",
    "read_discharge",
    "read_table",
    "to_data",
    "vehicle_thrust",
    "verify",
    "write_raw",
]
