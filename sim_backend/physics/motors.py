"""Motors with propellers: first-order thrust with time constants up and down, arms and drag torque."""

import math
from typing import Any

from onboard.jit import kernel
from onboard.mixer import Thrusts

Wrench = tuple[float, float, float, float, float, float]

SETTLED = 1e-15
"""N: a thrust this close to its target is there; a stopped motor would decay into slow denormal numbers."""


@kernel
def decay(p: Any, dt: float) -> tuple[float, float]:
    """What is left of a thrust error after `dt` (s), for a rising and a falling thrust: exp(-dt / tau)."""
    return math.exp(-dt / p.time_constant_up), math.exp(-dt / p.time_constant_down)


@kernel
def lag(thrust: float, target: float, decay_up: float, decay_down: float) -> float:
    """Thrust (N) of one motor after the time that belongs to the decays; exact for a constant target."""
    error = thrust - target
    if abs(error) < SETTLED:
        return target
    return target + error * (decay_up if error < 0.0 else decay_down)


@kernel
def commanded(state: Any, p: Any, targets: Thrusts) -> Thrusts:
    """What the motors head for (N) in this step when they are told `targets`: to be called once a step."""
    return targets


@kernel
def lag_all(state: Any, p: Any, targets: Thrusts, decay_up: float, decay_down: float, dt: float) -> None:
    """Advance the four thrusts of the state towards their targets (N).

    Args:
        state: record, changed in place.
        p: record of parameters.
        targets: from :func:`commanded`.
        decay_up, decay_down: from :func:`decay` for the same `dt`.
        dt: s, half a step: the forces are taken between two calls.
    """
    thrust = state.thrust
    thrust[0] = lag(thrust[0], targets[0], decay_up, decay_down)
    thrust[1] = lag(thrust[1], targets[1], decay_up, decay_down)
    thrust[2] = lag(thrust[2], targets[2], decay_up, decay_down)
    thrust[3] = lag(thrust[3], targets[3], decay_up, decay_down)


@kernel
def rotor_wrench(state: Any, p: Any) -> Wrench:
    """Force (N) and torque (N m) of the four rotors in the body frame.

    tau_x = sum y_i F_i, tau_y = -sum x_i F_i, tau_z = c (F2 + F4 - F1 - F3): M1 and M3 turn
    counter-clockwise seen from above.
    """
    f1, f2, f3, f4 = state.thrust[0], state.thrust[1], state.thrust[2], state.thrust[3]
    return (
        0.0,
        0.0,
        f1 + f2 + f3 + f4,
        p.arm_y * (f3 + f4 - f1 - f2),
        p.arm_x * (f2 + f3 - f1 - f4),
        p.thrust_to_torque * (f2 + f4 - f1 - f3),
    )
