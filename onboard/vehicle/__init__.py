"""The vehicle description: the single truth of what the drone is.

:func:`load_vehicle` reads a vehicle file (docs/vehicle_file.md) or one of the vehicles that ship with the
code. The dataclasses live in :mod:`onboard.vehicle.model`, the checks in :mod:`onboard.vehicle.schema`, the
file format in :mod:`onboard.vehicle.file_format`; the names are gathered here.
"""

import dataclasses
from functools import cache
from pathlib import Path

from onboard.quantity import Quantity
from onboard.toml_file import read_toml
from onboard.vehicle.effects import EFFECTS
from onboard.vehicle.file_format import (
    LEGS_FILE,
    LIBRARY,
    THRUST_MAPS_FILE,
    leg_design_names,
    parse_vehicle,
    read_leg_design,
    read_thrust_map,
    thrust_map_names,
    vehicle_to_toml,
)
from onboard.vehicle.model import (
    EFFECT_NAMES,
    SCHEMA,
    Air,
    Battery,
    Body,
    Effect,
    Legs,
    Motors,
    Sensing,
    ThrustMapDescription,
    Vehicle,
)
from onboard.vehicle.schema import VehicleFileError

__all__ = [
    "EFFECTS",
    "EFFECT_NAMES",
    "SCHEMA",
    "Air",
    "Battery",
    "Body",
    "Effect",
    "Legs",
    "Motors",
    "Quantity",
    "Sensing",
    "ThrustMapDescription",
    "Vehicle",
    "VehicleFileError",
    "check_vehicle",
    "known_leg_designs",
    "known_thrust_maps",
    "known_vehicles",
    "load_vehicle",
    "read_leg_design",
    "read_thrust_map",
    "vehicle_to_toml",
]


@cache
def known_vehicles() -> tuple[str, ...]:
    """Names of the vehicles that ship with the code."""
    libraries = (LEGS_FILE, THRUST_MAPS_FILE)
    return tuple(sorted(path.stem for path in LIBRARY.glob("*.toml") if path not in libraries))


def known_leg_designs() -> tuple[str, ...]:
    """Names of the leg designs that ship with the code: the six of the paper's Table I."""
    return leg_design_names()


def known_thrust_maps() -> tuple[str, ...]:
    """Names of the thrust maps that ship with the code."""
    return thrust_map_names()


def _vehicle_path(name_or_path: str | Path) -> Path:
    """The file of a known vehicle, or the path itself.

    Raises:
        VehicleFileError: neither a known name nor a file.
    """
    if str(name_or_path) in known_vehicles():
        return LIBRARY / f"{name_or_path}.toml"
    path = Path(name_or_path)
    if path.suffix != ".toml" and not path.is_file():
        raise VehicleFileError(
            f"{name_or_path}: no such vehicle; give the path of a vehicle file or one of "
            f"{', '.join(known_vehicles())}"
        )
    return path


def load_vehicle(name_or_path: str | Path, legs: str | None = None) -> Vehicle:
    """Read a vehicle and check all of it.

    Args:
        name_or_path: a name from :func:`known_vehicles` or the path of a vehicle file.
        legs: a name from :func:`known_leg_designs` that replaces the legs. Mass and inertia stay as they
            are: the authors used those of the measured vehicle for every design (SIM@4c815026:
            crazyflie_launch/config/Model_Types.yaml, "Not Experimentally Measured").

    Raises:
        VehicleFileError: the file cannot be used; the message has one line a problem, with file and key.
    """
    path = _vehicle_path(name_or_path)
    vehicle = _shipped(path) if path.parent == LIBRARY else _read(path)
    return vehicle if legs is None else dataclasses.replace(vehicle, legs=read_leg_design(legs))


def _read(path: Path) -> Vehicle:
    return parse_vehicle(read_toml(path, VehicleFileError), str(path))


@cache
def _shipped(path: Path) -> Vehicle:
    """One that ships with the code and stays as it is while that runs; flights and pages ask for it often."""
    return _read(path)


def check_vehicle(path: str | Path) -> list[str]:
    """Everything that is wrong with a vehicle file, one sentence a problem; empty when it can be used."""
    try:
        load_vehicle(path)
    except VehicleFileError as error:
        return str(error).splitlines()
    return []
