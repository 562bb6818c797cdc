"""States to start from."""

import math
from typing import Any

import numpy as np

from onboard.arrays import FloatArray
from onboard.battery import open_circuit_voltage
from sim_backend.physics.state import new_state
from sim_backend.physics.step import step


def charged(state: Any, parameters: Any, charge_used: float = 0.0) -> Any:
    """Give the state a battery from which `charge_used` (C) has been drawn; returns the state."""
    state["charge_used"] = charge_used
    state["battery_voltage"] = open_circuit_voltage(
        parameters["open_circuit_full"],
        parameters["open_circuit_slope"],
        parameters["battery_capacity"],
        charge_used,
    )
    return state


def with_cold_motors(state: Any) -> Any:
    """Give the state motors that have stood for long; returns the state."""
    state["coldness"] = 1.0
    return state


def resting_on_floor(parameters: Any, x: float, y: float, yaw: float, charge_used: float = 0.0) -> Any:
    """A vehicle that stands on the floor with its motors off.

    Args:
        parameters: record of physics parameters.
        x, y: m, world.
        yaw: rad.
        charge_used: C drawn from the battery.

    Returns:
        A state that has settled on its legs (or its hull, without legs); its time is 0.
    """
    state = with_cold_motors(charged(new_state(), parameters, charge_used))
    feet = np.full(1, np.inf)
    if parameters["has_legs"]:
        feet = parameters["hip"][:, 2] + parameters["leg_length"] * parameters["leg_direction"][:, 2]
        feet = feet - parameters["foot_radius"]
    lowest = min(
        float(np.min(feet)), float(parameters["body_bottom_z"]), float(parameters["propeller_height_z"])
    )
    state["position"] = [x, y, -lowest]
    state["quaternion"] = [0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)]
    still = np.zeros(4)
    for _ in range(2000):
        # Settling is not part of the story: friction between the steps takes the energy quickly.
        step(state, parameters, still, 0.001)
        state["velocity"] *= 0.9
        state["omega"] *= 0.9
    state["time"] = 0.0
    return charged(state, parameters, charge_used)


def approaching(parameters: Any, position: FloatArray, velocity: FloatArray) -> Any:
    """A level vehicle in flight at exactly `velocity` (m/s, world), hovering thrust on all motors."""
    state = charged(new_state(), parameters)
    state["position"] = position
    state["velocity"] = velocity
    state["thrust"] = parameters["mass"] * parameters["gravity"] / 4.0
    return state
