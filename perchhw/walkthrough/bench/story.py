"""What is different about the drone of the walk-through, and what is flown."""

import dataclasses
from pathlib import Path

from onboard.quantity import Quantity
from onboard.vehicle import Effect, ThrustMapDescription, Vehicle, load_vehicle, vehicle_to_toml
from perchhw.attempt import STORED_VEHICLE

BELIEVED = STORED_VEHICLE
"""The vehicle file before the bench: of the host, of the policy, and of the drone's firmware."""

INERTIA = {"xx": 1.25, "yy": 1.25, "zz": 1.20}
"""Factors on the file's inertias: a heavier frame than the one in the file."""

THRUST = 0.85
"""Factor on the thrust at a voltage: other propellers."""

SPEED_LAW = {"a_up": 0.0, "b_up": 3.6e-3, "a_down": 0.4, "b_down": 1.7e-3}
"""1/s and 1/rad: motors that follow more slowly than the file says (bench notes 1.2, the authors' logs)."""

TEST_FLIGHTS = ("thrust_steps", "attitude_doublets", "circles", "vertical_steps", "straight_laps")
"""Flights whose course is compared with what was flown."""

LANDING_SPEEDS, LANDING_ANGLES = (2.25, 2.5, 2.75), (42.5, 47.5, 52.5)
"""Conditions of the landing campaigns."""

_SOURCE = "true value of the walk-through's drone"


def true_vehicle() -> Vehicle:
    """The drone as it is."""
    believed = load_vehicle(BELIEVED)
    body, motors = believed.body, believed.motors
    inertia = {
        f"inertia_{axis}": _scaled(getattr(body, f"inertia_{axis}"), factor)
        for axis, factor in INERTIA.items()
    }
    thrust_map = ThrustMapDescription(
        form=motors.thrust_map.form,
        coefficients={key: _scaled(one, THRUST) for key, one in motors.thrust_map.coefficients.items()},
    )
    units = {"a_up": "1/s", "b_up": "1/rad", "a_down": "1/s", "b_down": "1/rad"}
    law = Effect(
        name="motor_speed_law",
        parameters={key: Quantity(value, units[key], 0.0, _SOURCE) for key, value in SPEED_LAW.items()},
    )
    return dataclasses.replace(
        believed,
        body=dataclasses.replace(body, **inertia),
        motors=dataclasses.replace(motors, thrust_map=thrust_map),
        effects=(law,),
    )


def _scaled(quantity: Quantity, factor: float) -> Quantity:
    """In a map of quadratics all coefficients are thrusts over powers of volts: so the thrust scales."""
    return Quantity(quantity.value * factor, quantity.unit, 0.0, _SOURCE)


def write_true(folder: Path) -> Path:
    """Write the file of the drone as it is, for the simulated drone alone."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "vehicle.toml"
    path.write_text(vehicle_to_toml(true_vehicle()), encoding="utf-8")
    return path
