"""Battery compensation: which share of the battery voltage gives a motor the thrust that is asked for.

The forms of thrust map are described in :mod:`onboard.thrust_map`. Everything is compiled, in SI units, and
total: a request that is not a number, or a battery that is not there, gives a motor that stands still.
"""

import math

from onboard.jit import inner, kernel
from onboard.thrust_map import ThrustMap, ThrustMapForm

__all__ = [
    "FULL_RATIO",
    "ThrustMap",
    "ThrustMapForm",
    "battery_current",
    "duty_for_thrust",
    "open_circuit_voltage",
    "quantise_pwm",
    "terminal_voltage",
    "thrust_from_voltage",
    "voltage_from_thrust",
]

_QUADRATIC = int(ThrustMapForm.QUADRATIC_INVERSE)
_CUBIC = int(ThrustMapForm.FIRMWARE_CUBIC)

FULL_RATIO = 65535
"""Full scale of the motor command: 16 bits, whatever the timer makes of them."""
LOWEST_BATTERY_VOLTAGE = 2.0
"""V. Below it the firmware gives no PWM at all (crazyflie-firmware@2a18fc29, battery compensation)."""

_NEWTON_STEPS = 60

_HIGHEST_VOLTAGE = 128.0
"""V: more than packs of any multirotor have; the app on the drone stops at 16 V, above any Crazyflie's."""


@inner
def _quadratic_root(a: float, b: float, c: float, thrust: float) -> float:
    return (-b + math.sqrt(max(0.0, b * b + 4.0 * a * (thrust - c)))) / (2.0 * a)


@inner
def _cubic_root(c0: float, c1: float, c2: float, c3: float, thrust: float) -> float:
    """Voltage at which an increasing cubic gives `thrust`: Newton's method kept inside a bracket."""
    if thrust <= c0:
        return 0.0
    low, high = 0.0, 16.0
    while high < _HIGHEST_VOLTAGE and c0 + high * (c1 + high * (c2 + high * c3)) < thrust:
        low, high = high, 2.0 * high
    voltage = max(low, 2.0)
    for _ in range(_NEWTON_STEPS):
        excess = c0 + voltage * (c1 + voltage * (c2 + voltage * c3)) - thrust
        if excess > 0.0:
            high = voltage
        else:
            low = voltage
        slope = c1 + voltage * (2.0 * c2 + voltage * 3.0 * c3)
        following = voltage - excess / slope if slope > 0.0 else low
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - voltage) < 1e-13:
            return following
        voltage = following
    return voltage


@kernel
def voltage_from_thrust(thrust_map: ThrustMap, thrust: float) -> float:
    """Voltage (V) at the motor that gives `thrust` (N); 0 for a thrust of 0, below, or not a number."""
    if not thrust > 0.0:
        return 0.0
    c = thrust_map.coefficients
    if thrust_map.form == _QUADRATIC:
        if thrust <= c[6]:
            return max(0.0, _quadratic_root(c[0], c[1], c[2], thrust))
        return _quadratic_root(c[3], c[4], c[5], thrust)
    if thrust_map.form == _CUBIC:
        return _cubic_root(c[0], c[1], c[2], c[3], thrust)
    if thrust <= c[4]:
        return c[0] * math.log(1.0 + thrust / c[1])
    return c[0] * math.log(1.0 + c[4] / c[1]) + c[2] * math.log((thrust + c[3]) / (c[4] + c[3]))


@kernel
def thrust_from_voltage(thrust_map: ThrustMap, voltage: float) -> float:
    """Settled thrust (N) of a motor at `voltage` (V); never negative.

    The two rows of a quadratic map do not meet: between the voltages that they give for `break_thrust` the
    thrust stays at `break_thrust`, so that it never falls when the voltage rises.
    """
    if not voltage > 0.0:
        return 0.0
    c = thrust_map.coefficients
    if thrust_map.form == _QUADRATIC:
        if voltage <= _quadratic_root(c[0], c[1], c[2], c[6]):
            return max(0.0, voltage * (c[0] * voltage + c[1]) + c[2])
        if voltage <= _quadratic_root(c[3], c[4], c[5], c[6]):
            return c[6]
        return voltage * (c[3] * voltage + c[4]) + c[5]
    if thrust_map.form == _CUBIC:
        return max(0.0, c[0] + voltage * (c[1] + voltage * (c[2] + voltage * c[3])))
    break_voltage = c[0] * math.log(1.0 + c[4] / c[1])
    if voltage <= break_voltage:
        return c[1] * (math.exp(voltage / c[0]) - 1.0)
    return (c[4] + c[3]) * math.exp((voltage - break_voltage) / c[2]) - c[3]


@kernel
def duty_for_thrust(
    thrust: float, battery_voltage: float, thrust_map: ThrustMap, thrust_min: float = 0.0
) -> float:
    """Share (0..1) of the battery voltage that gives a motor `thrust` (N).

    Args:
        thrust: N; at or below `thrust_min` the motor stops (errata 1: 0.25 g in the authors' firmware).
        battery_voltage: V at the terminals, now.
        thrust_map: map of this motor.
        thrust_min: N.

    Returns:
        The duty; 1 when the battery cannot give the thrust; 0 for an input that is not a number.
    """
    if not thrust > thrust_min or not battery_voltage >= LOWEST_BATTERY_VOLTAGE:
        return 0.0
    return min(voltage_from_thrust(thrust_map, thrust) / battery_voltage, 1.0)


@kernel
def quantise_pwm(duty: float, bits: int = 8) -> float:
    """The duty (0..1) that a timer of `bits` bits really applies to a 16-bit command.

    Brushed motors have 8 bits (crazyflie-firmware@2a18fc29, MOTORS_PWM_BITS): the command's low byte is
    dropped, so the most is 255/256.
    """
    if not duty > 0.0:
        return 0.0
    ratio = int(min(duty, 1.0) * FULL_RATIO)
    return float(ratio >> (16 - bits)) / float(1 << bits)


@kernel
def open_circuit_voltage(full: float, slope: float, capacity: float, charge_used: float) -> float:
    """Open-circuit voltage (V) after `charge_used` (C): falls by `slope` (V) over the `capacity` (C)."""
    return full - slope * charge_used / capacity


@kernel
def battery_current(current_per_newton: float, f1: float, f2: float, f3: float, f4: float) -> float:
    """Current (A) out of the battery for four thrusts (N): first model, proportional to their sum."""
    return current_per_newton * (f1 + f2 + f3 + f4)


@kernel
def terminal_voltage(open_circuit: float, resistance: float, current: float) -> float:
    """Voltage (V) at the terminals; never negative."""
    return max(0.0, open_circuit - resistance * current)
