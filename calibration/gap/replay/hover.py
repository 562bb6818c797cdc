"""What a controller that believes in a vehicle file commands to hold a model in hover."""

from typing import Any

import numpy as np

from onboard.arrays import Vector
from onboard.battery import duty_for_thrust, thrust_from_voltage
from onboard.controller import ControllerGains
from onboard.mixer import mix
from onboard.thrust_map import ThrustMap
from sim_backend.physics.battery import motor_targets
from sim_backend.physics.forces import free_flight_wrench
from sim_backend.physics.jit import kernel, outlined
from sim_backend.physics.motors import commanded
from sim_backend.physics.reset import with_cold_motors
from sim_backend.physics.state import new_state

_STEPS = 20
"""Each leaves the share by which the motors are weaker than believed."""

_HIGH = 1e3
"""m above the floor."""

Held = tuple[float, float, float, float]
"""Collective (N) and moments (N m, body)."""


@kernel
def mixed(state: Any, p: Any, thrust_map: ThrustMap, collective: float, moments: Vector, duty: Any) -> None:
    """Duties of mixer and battery compensation, into `duty` (4,), for a collective (N) and moments (N m).

    The limit is full duty, as that of every firmware, not the thrust that a vehicle file thinks a motor has.
    """
    most = thrust_from_voltage(thrust_map, state.battery_voltage)
    thrusts = mix(collective, moments[0], moments[1], moments[2], p.arm_x, p.arm_y, p.thrust_to_torque, most)
    for motor in range(4):
        duty[motor] = duty_for_thrust(thrusts[motor], state.battery_voltage, thrust_map, 0.0)


@outlined
def _held(state: Any, p: Any, gains: ControllerGains, thrust_map: ThrustMap) -> Held:
    level, duty = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), np.zeros(4)
    collective, x, y, z = gains.mass * p.gravity, 0.0, 0.0, 0.0
    for _ in range(_STEPS):
        mixed(state, p, thrust_map, collective, (x, y, z), duty)
        targets = commanded(state, p, motor_targets(state, p, duty))
        for motor in range(4):
            state.thrust[motor] = targets[motor]
        _, _, fz, tx, ty, tz = free_flight_wrench(state, p, level, 0.0, 0.0, 0.0)
        collective += p.mass * p.gravity - fz
        x, y, z = x - tx, y - ty, z - tz
    return collective, x, y, z


def hover_command(parameters: Any, gains: ControllerGains, thrust_map: ThrustMap, voltage: float) -> Held:
    """Collective (N) and moments (N m) that hold a model level, far from floor and ceiling, as its
    controller believes them.

    Args:
        parameters: record of physics parameters of the model.
        gains, thrust_map: of the controller and its battery compensation.
        voltage: V, of the battery.
    """
    prompt = parameters.copy()
    prompt["delay_steps"], prompt["ceiling_z"] = 0.0, np.inf
    state = with_cold_motors(new_state())
    state["position"] = (0.0, 0.0, _HIGH)
    state["battery_voltage"] = voltage
    return _held(state, prompt, gains, thrust_map)
