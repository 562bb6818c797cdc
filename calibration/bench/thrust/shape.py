"""What a thrust map must be before it may fly: rising, without gaps, invertible, also in the firmware."""

import numpy as np

from onboard.arrays import FloatArray
from onboard.battery import thrust_from_voltage, voltage_from_thrust
from onboard.gravity import GRAM_FORCE
from onboard.thrust_map import ThrustMap, ThrustMapForm

GRID = 1e-3
"""V."""
HIGHEST_VOLTAGE = 5.0
"""V: vehicle files ask a cubic to rise up to here."""
JUMP_LIMIT = 1e-3
"""V at the break between two rows."""
INVERSE_LIMIT = 1e-6
FIRMWARE_LIMIT = 1e-3
"""V."""
HEADROOM = 1.2
"""Times the highest thrust up to which a voltage must exist."""


def forward(thrust_map: ThrustMap, voltage: FloatArray) -> FloatArray:
    """Thrust (N) at each voltage (V)."""
    return np.array([thrust_from_voltage(thrust_map, float(v)) for v in voltage])


def inverse(thrust_map: ThrustMap, thrust: FloatArray) -> FloatArray:
    """Voltage (V) for each thrust (N)."""
    return np.array([voltage_from_thrust(thrust_map, float(f)) for f in thrust])


def firmware_inverse(cubic: FloatArray, thrust: FloatArray) -> FloatArray:
    """Voltage (V) for each thrust (N) in the single precision of the Crazyflie's firmware.

    Cardano's formula for one real root: V = cbrt(q + s) + cbrt(q - s) + p with p = -c2/(3 c3), r = c1/(3 c3),
    q = p^3 + (c2 c1 - 3 c3 (c0 - f)) / (6 c3^2), s = sqrt(q^2 + (r - p^2)^3)
    (crazyflie-firmware, motors.c, battery compensation). NaN where s has no real value.

    Args:
        cubic: (4,) c0..c3 in N, N/V, N/V2, N/V3.
        thrust: (n,) N.
    """
    c0, c1, c2, c3 = (np.float32(c) for c in cubic)
    three, six = np.float32(3.0), np.float32(6.0)
    f = np.asarray(thrust, dtype=np.float32)
    p = -c2 / (three * c3)
    r = c1 / (three * c3)
    q = p * p * p + (c2 * c1 - three * c3 * (c0 - f)) / (six * c3 * c3)
    spread = r - p * p
    under = q * q + spread * spread * spread
    s = np.sqrt(np.where(under >= 0.0, under, np.float32(np.nan)))
    return np.asarray(np.cbrt(q + s) + np.cbrt(q - s) + p, dtype=np.float64)


def shape_problems(thrust_map: ThrustMap, thrust_min: float, thrust_max: float) -> list[str]:
    """What keeps a map from being used between two thrusts (N), in plain words; empty when it is fine."""
    problems: list[str] = []
    grid = np.arange(GRID, HIGHEST_VOLTAGE, GRID)
    thrust = forward(thrust_map, grid)
    if not np.all(np.isfinite(thrust)):
        problems.append("no thrust at some voltages")
    elif np.any(np.diff(thrust[thrust > 0.0]) <= 0.0):
        at = grid[thrust > 0.0][:-1][np.diff(thrust[thrust > 0.0]) <= 0.0][0]
        problems.append(f"thrust does not rise with the voltage at {at:.3f} V")
    asked = np.linspace(0.0, HEADROOM * thrust_max, 400)
    if not np.all(np.isfinite(inverse(thrust_map, asked))):
        problems.append(f"no voltage for some thrusts up to {HEADROOM * thrust_max / GRAM_FORCE:.1f} gf")
    if thrust_map.form != ThrustMapForm.FIRMWARE_CUBIC:
        problems += _jump(thrust_map)
    inside = np.linspace(thrust_min, thrust_max, 400)[1:]
    back = forward(thrust_map, inverse(thrust_map, inside))
    worst = float(np.max(np.abs(back / inside - 1.0)))
    if not problems and not worst <= INVERSE_LIMIT:
        problems.append(
            f"a voltage and its thrust differ by {worst:.1e} on the way back (limit {INVERSE_LIMIT})"
        )
    if thrust_map.form == ThrustMapForm.FIRMWARE_CUBIC:
        problems += _firmware(thrust_map, inside)
    return problems


def _jump(thrust_map: ThrustMap) -> list[str]:
    index = 6 if thrust_map.form == ThrustMapForm.QUADRATIC_INVERSE else 4
    at = float(thrust_map.coefficients[index])
    step = voltage_from_thrust(thrust_map, at * (1.0 + 1e-9)) - voltage_from_thrust(thrust_map, at)
    if abs(step) <= JUMP_LIMIT:
        return []
    return [f"a jump of {1e3 * step:.0f} mV at {at / GRAM_FORCE:.1f} gf (limit 1 mV)"]


def _firmware(thrust_map: ThrustMap, thrust: FloatArray) -> list[str]:
    single = firmware_inverse(thrust_map.coefficients[:4], thrust)
    worst = float(np.max(np.abs(single - inverse(thrust_map, thrust))))
    if worst <= FIRMWARE_LIMIT:
        return []
    return [f"the firmware's formula is off by {1e3 * worst:.1f} mV, or has no root (limit 1 mV)"]
