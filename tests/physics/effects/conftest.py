"""Vehicles with effects, at the paper's flying vehicle."""

import dataclasses
from collections.abc import Mapping
from typing import Any, Protocol

import pytest

from onboard.quantity import Quantity
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Effect, Vehicle, load_vehicle
from sim_backend.physics.parameters import physics_parameters

Effects = Mapping[str, Mapping[str, float]]
"""Values (SI) of the parameters by effect."""

RADIUS = 0.0225
"""m, propeller of the vehicle."""


class MakeParameters(Protocol):
    """Parameters of the vehicle with effects."""

    def __call__(self, effects: Effects, ceiling_z: float = ...) -> Any: ...


def with_effects(effects: Effects, vehicle: Vehicle | None = None) -> Vehicle:
    """The vehicle with these effects."""
    made = tuple(
        Effect(
            name=name,
            parameters={
                key: Quantity(value, EFFECTS[name].parameters[key].unit, 0.0, "test case")
                for key, value in values.items()
            },
        )
        for name, values in effects.items()
    )
    return dataclasses.replace(vehicle or load_vehicle("crazyflie21-upgraded-stored"), effects=made)


def typical(name: str) -> dict[str, float]:
    """Typical values of an effect."""
    return {key: parameter.typical for key, parameter in EFFECTS[name].parameters.items()}


@pytest.fixture
def make() -> MakeParameters:
    """Makes fresh parameters of the vehicle with effects, far from any ceiling unless one is given."""

    def parameters(effects: Effects, ceiling_z: float = 1e6) -> Any:
        return physics_parameters(with_effects(effects), RoomGeometry(ceiling_z=ceiling_z))

    return parameters
