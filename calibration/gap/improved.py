"""The improved vehicle: the file that was given, with the effects that were found, each with its source."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from onboard.quantity import Quantity
from onboard.vehicle import EFFECTS, Effect, Vehicle, vehicle_to_toml

VEHICLE_FILE = "vehicle.toml"


@dataclass(frozen=True)
class FoundValue:
    """A parameter as found: value and standard error, SI."""

    value: float
    error: float


def improved_vehicle(vehicle: Vehicle, found: Mapping[str, Mapping[str, FoundValue]], source: str) -> Vehicle:
    """A vehicle with effects added, or put in the place of those that it had under the same names.

    Args:
        vehicle: as given.
        found: by effect and parameter; parameters that were not found stay neutral.
        source: provenance of the numbers, for the file.
    """
    effects = [
        Effect(
            name=name,
            parameters={
                key: Quantity(one.value, EFFECTS[name].parameters[key].unit, one.error, source)
                for key, one in values.items()
            },
        )
        for name, values in found.items()
    ]
    kept = tuple(effect for effect in vehicle.effects if effect.name not in found)
    return dataclasses.replace(vehicle, effects=(*kept, *effects))


def provenance(flights: int, held_out: int, seed: int) -> str:
    """Where a number of the gap finder comes from, for the file."""
    return f"gap finder: fitted to {flights} flights, checked on {held_out} others, seed {seed}"


def write_vehicle(vehicle: Vehicle, folder: Path) -> Path:
    """Write ``vehicle.toml`` into the report's folder; returns the file."""
    file = folder / VEHICLE_FILE
    file.write_text(vehicle_to_toml(vehicle), encoding="utf-8")
    return file


def separations(names: Sequence[str]) -> str:
    """What a flight must do to tell effects apart, in words."""
    return "; ".join(f"{name}: {EFFECTS[name].revealed_by}" for name in names)
