"""Thrust against motor voltage: tables, forms, their choice, battery compensation.

:func:`read_table` and :func:`analyse` are the whole way from a file to a :class:`ThrustResult`;
docs/bench_thrust.md tells the physics. Everything here is pure: files in, numbers and findings out.
"""

from calibration.bench.thrust.analysis import analyse, questions, read_table
from calibration.bench.thrust.compensation import (
    Discharge,
    Verification,
    achievable,
    read_discharge,
    verify,
)
from calibration.bench.thrust.data import ThrustData
from calibration.bench.thrust.errors import ThrustTableError
from calibration.bench.thrust.pwm import applied_duty, exact_set_points
from calibration.bench.thrust.raw_table import RawTable, to_data, write_raw
from calibration.bench.thrust.thrust_result import ThrustResult, VehicleThrust, imported_json, vehicle_thrust
from calibration.bench.thrust.units import Units

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
