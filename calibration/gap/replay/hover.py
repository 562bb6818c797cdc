"""What a controller that believes in a vehicle file commands to hold a model in hover."""

from typing import Any, NamedTuple

import numpy as np

from onboard.arrays import FloatArray, Vector
from onboard.battery import LOWEST_BATTERY_VOLTAGE, voltage_from_thrust
from onboard.controller import ControllerGains
from onboard.mixer import on_motors, shares
from onboard.thrust_map import ThrustMap
from sim_backend.physics.battery import motor_targets
from sim_backend.physics.forces import free_flight_wrench
from sim_backend.physics.jit import kernel, outlined
from sim_backend.physics.motors import commanded
from sim_backend.physics.reset import with_cold_motors
from sim_backend.physics.state import new_state

_STEPS = 60
"""Each leaves half of what is lacking, or the share by which motors are weaker than believed: enough for a
thrust of a quarter to four times what is believed."""

_HELD = 0.01
"""Share of the weight, and of that weight on an arm, that may be lacking in a hover."""


class HoverCommand(NamedTuple):
    """What holds a model level and at rest, as its controller believes it.

    Attributes:
        collective: N.
        moments: N m, body.
    """

    collective: float
    moments: Vector


@kernel
def mixed(state: Any, p: Any, thrust_map: ThrustMap, collective: float, moments: Vector, duty: Any) -> None:
    """Duties of mixer and battery compensation, into `duty` (4,), for a collective (N) and moments (N m).

    As the firmware of a Crazyflie: by how much the first motor is beyond full duty is taken from all, so that
    moments stay and the collective goes (crazyflie-firmware@2a18fc29, powerDistributionCap; in measured
    flights one motor at a time stands at full duty).
    """
    roll, pitch, yaw = shares(moments[0], moments[1], moments[2], p.arm_x, p.arm_y, p.thrust_to_torque)
    m1, m2, m3, m4 = on_motors(0.25 * collective, roll, pitch, yaw)
    duty[0] = voltage_from_thrust(thrust_map, m1)
    duty[1] = voltage_from_thrust(thrust_map, m2)
    duty[2] = voltage_from_thrust(thrust_map, m3)
    duty[3] = voltage_from_thrust(thrust_map, m4)
    battery = max(state.battery_voltage, LOWEST_BATTERY_VOLTAGE)
    beyond = max(max(duty[0], duty[1], duty[2], duty[3]) - battery, 0.0)
    for motor in range(4):
        duty[motor] = max(duty[motor] - beyond, 0.0) / battery


@outlined
def _held(state: Any, p: Any, thrust_map: ThrustMap, pushed: Vector) -> tuple[float, Vector, float]:
    """Collective, moments, and the share of weight and levers that they leave."""
    level, duty = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), np.zeros(4)
    weight = p.mass * p.gravity
    collective, x, y, z, lacking = weight, 0.0, 0.0, 0.0, 1.0
    for _ in range(_STEPS):
        mixed(state, p, thrust_map, collective, (x, y, z), duty)
        targets = commanded(state, p, motor_targets(state, p, duty))
        for motor in range(4):
            state.thrust[motor] = targets[motor]
        _, _, fz, tx, ty, tz = free_flight_wrench(state, p, level, 0.0, 0.0, 0.0)
        tx, ty, tz = tx + pushed[0], ty + pushed[1], tz + pushed[2]
        turned = max(abs(tx) / p.arm_y, abs(ty) / p.arm_x, abs(tz) / p.thrust_to_torque)
        lacking = max(abs(weight - fz), turned) / weight
        collective += 0.5 * (weight - fz)
        x, y, z = x - 0.5 * tx, y - 0.5 * ty, z - 0.5 * tz
    return collective, (x, y, z), lacking


def up_to_full_duty(gains: ControllerGains, most: float) -> ControllerGains:
    """Gains of a controller that stops at full duty, as every firmware, not at the thrust that a vehicle file
    thinks a motor has; `most`: N, what a motor gives at full duty, as it believes."""
    return gains._replace(collective_max=4.0 * most)


def hover_command(
    parameters: Any,
    thrust_map: ThrustMap,
    voltage: float,
    place: FloatArray,
    pushed: Vector = (0.0, 0.0, 0.0),
) -> HoverCommand | None:
    """What holds a model level at a place, without a string; None where nothing does.

    Args:
        parameters: record of physics parameters of the model.
        thrust_map: of the controller's battery compensation.
        voltage: V, of the battery.
        place: m, world.
        pushed: N m, body, moments that act on the model besides.
    """
    prompt = parameters.copy()
    prompt["delay_steps"] = prompt["tether_stiffness"] = prompt["tether_damping"] = 0.0
    state = with_cold_motors(new_state())
    state["position"], state["battery_voltage"] = place, voltage
    collective, moments, lacking = _held(state, prompt, thrust_map, pushed)
    return HoverCommand(collective, moments) if lacking < _HELD else None
