"""What happens in the walk-through: which change is hidden, and what is flown."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from onboard.quantity import Quantity
from onboard.vehicle import EFFECTS, Effect, Vehicle, load_vehicle, vehicle_to_toml
from perchhw.attempt import STORED_VEHICLE

BELIEVED = STORED_VEHICLE
"""The vehicle file that everybody but the simulated drone believes: its feet always hold, so that
what lands is decided by what is hidden here."""

HIDDEN: Mapping[str, Mapping[str, float]] = {
    "thrust_scale": {"scale": 0.9},
    "motor_lag": {"scale": 1.2},
    "leg_stiffness": {"scale": 0.3},
}
"""Worn propellers and motors, and hinges that have gone soft."""

LANDING_SPEEDS, LANDING_ANGLES = (2.25, 2.5, 2.75), (42.5, 47.5, 52.5)
"""Conditions of the campaign in the lab."""

TEST_FLIGHTS = (
    "thrust_steps",
    "attitude_doublets",
    "circles",
    "vertical_steps",
    "chirp",
    "throttle_chops",
    "yaw_steps",
    "straight_laps",
    "thrust_steps",
    "attitude_doublets",
    "circles",
    "vertical_steps",
)
"""Test flights of the campaign, in their order."""


def hidden_vehicle() -> Vehicle:
    """The drone as it is."""
    believed = load_vehicle(BELIEVED)
    effects = tuple(
        Effect(
            name=name,
            parameters={
                key: Quantity(value, EFFECTS[name].parameters[key].unit, 0.0, "hidden change")
                for key, value in values.items()
            },
        )
        for name, values in HIDDEN.items()
    )
    return dataclasses.replace(believed, effects=effects)


def write_hidden(folder: Path) -> Path:
    """Write the file of the hidden vehicle, for the simulated drone alone."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "vehicle.toml"
    path.write_text(vehicle_to_toml(hidden_vehicle()), encoding="utf-8")
    return path
