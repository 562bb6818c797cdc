"""Battery and motor supply: open circuit by charge, one resistance, current from the thrust."""

from typing import Any

from onboard.battery import battery_current, open_circuit_voltage, terminal_voltage, thrust_from_voltage
from onboard.mixer import Thrusts
from onboard.thrust_map import ThrustMap
from sim_backend.physics.jit import inner, kernel


@inner
def motor_targets(state: Any, p: Any, duty: Any) -> Thrusts:
    """Thrusts (N) that the motors head for at these duties (0..1) of the present battery voltage."""
    voltage = state.battery_voltage
    thrust_map = ThrustMap(p.thrust_map_form, p.thrust_map_coefficients)
    return (
        thrust_from_voltage(thrust_map, min(max(duty[0], 0.0), 1.0) * voltage),
        thrust_from_voltage(thrust_map, min(max(duty[1], 0.0), 1.0) * voltage),
        thrust_from_voltage(thrust_map, min(max(duty[2], 0.0), 1.0) * voltage),
        thrust_from_voltage(thrust_map, min(max(duty[3], 0.0), 1.0) * voltage),
    )


@kernel
def draw(state: Any, p: Any, dt: float) -> None:
    """Draw the motors' current for `dt` (s) and set the terminal voltage for the next step."""
    thrust = state.thrust
    current = battery_current(p.current_per_newton, thrust[0], thrust[1], thrust[2], thrust[3])
    state.battery_current = current
    state.charge_used += current * dt
    rest = open_circuit_voltage(
        p.open_circuit_full, p.open_circuit_slope, p.battery_capacity, state.charge_used
    )
    state.battery_voltage = terminal_voltage(rest, p.battery_resistance, current)
