"""The vehicle of the independent landings: numbers of the paper and its errata, typed in again, SI."""

from dataclasses import dataclass

import numpy as np

GRAM = 9.80665e-3  # N


@dataclass(frozen=True)
class Drone:
    """Upgraded Crazyflie with semi-narrow-long legs (docs/physics.md, docs/vehicle_file.md)."""

    mass: float = 0.0381
    inertia: tuple[float, float, float] = (27.93e-6, 30.46e-6, 47.12e-6)
    arm: float = 0.0325
    torque_length: float = 6.18e-3
    thrust_most: float = 15.0 * GRAM
    lag_up: float = 0.05
    lag_down: float = 0.15
    box_half: float = 0.0375
    box_top: float = 0.015
    box_bottom: float = -0.0075
    propeller_radius: float = 0.0225
    propeller_z: float = 0.014
    hip: float = 0.017
    hip_z: float = -0.005
    leg: float = 0.075
    leg_angle: float = np.pi / 6.0
    foot_radius: float = 0.004
    stiffness: float = 0.08
    damping: float = 6.788e-5
    side_stiffness: float = 1.0
    side_damping: float = 1.0
    stop: float = np.pi / 3.0
    rod_stiffness: float = 5000.0
    rod_damping: float = 5.0
    adhesion: float = 1e9
    preload: float = 0.0
    capture: float = 0.0
    capture_spread: float = 0.0
    restitution: float = 0.3
    hull_friction: float = 0.5
    foot_friction: float = 1.0
    battery: float = 4.05
    resistance: float = 0.23
    ampere_per_newton: float = 7.5


QUADRATICS = ((1.285, 1.512, 0.0), (3.230, -5.469, 5.979))
"""gf over V, below and above 5 gf: paper, table Battery Compensation Parameters, read as a quadratic."""


def volts(newton: float) -> float:
    """Voltage of a motor for a thrust."""
    grams = newton / GRAM
    if grams <= 0.25:
        return 0.0
    a, b, c = QUADRATICS[0] if grams <= 5.0 else QUADRATICS[1]
    return float((-b + np.sqrt(b * b + 4.0 * a * (grams - c))) / (2.0 * a))


def newton(volt: float) -> float:
    """Thrust of a motor at a voltage; flat where the two quadratics leave a step."""
    low, high = (a * volt**2 + b * volt + c for a, b, c in QUADRATICS)
    if low <= 5.0:
        return max(low, 0.0) * GRAM
    return max(high, 5.0) * GRAM
