"""Motors with propellers: first-order thrust with time constants up and down, arms and drag torque.

Effects (delay, gains, speed law ...) come in by one test each; a vehicle without them does not pay for them.
"""

import math
from typing import Any

from onboard.jit import kernel, outlined
from onboard.mixer import Thrusts
from sim_backend.physics.effects.command import command_with_effects
from sim_backend.physics.effects.motor_speed_law import speed_after

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
    if p.command_on:
        return command_with_effects(state, p, targets)
    return targets


@outlined
def follow_speed_law(state: Any, p: Any, targets: Thrusts, dt: float) -> None:
    """Advance thrusts by the speed law for `dt` (s); the acceleration is the mean over twice that time."""
    thrust, acceleration = state.thrust, state.rotor_acceleration
    per_time = 0.5 / dt
    for motor in range(4):
        target = targets[motor]
        rising = target > thrust[motor]
        a = p.speed_law_a[0] if rising else p.speed_law_a[1]
        b = p.speed_law_b[0] if rising else p.speed_law_b[1]
        settled = math.sqrt(target * p.speed2_per_thrust)
        before = math.sqrt(thrust[motor] * p.speed2_per_thrust)
        speed = speed_after(before, settled, a, b, dt)
        acceleration[motor] = (speed_after(speed, settled, a, b, dt) - before) * per_time
        after = speed * speed * p.thrust_per_speed2
        thrust[motor] = after if after > SETTLED else 0.0


@outlined
def follow_lag(state: Any, p: Any, targets: Thrusts, decay_up: float, decay_down: float, dt: float) -> None:
    """Advance thrusts as :func:`lag` for `dt` (s); the acceleration is the mean over twice that time."""
    thrust, acceleration = state.thrust, state.rotor_acceleration
    per_time = 0.5 / dt
    for motor in range(4):
        before, target = thrust[motor], targets[motor]
        after = lag(before, target, decay_up, decay_down)
        later = lag(after, target, decay_up, decay_down)
        change = math.sqrt(later * p.speed2_per_thrust) - math.sqrt(before * p.speed2_per_thrust)
        acceleration[motor] = change * per_time
        thrust[motor] = after


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
    if p.motors_on:
        # The forces are taken after the first of two such calls: the mean acceleration over both is what they
        # need. After the second call it is that of a step that may not come, and nobody looks at it.
        if p.speed_law_b[0] > 0.0:
            follow_speed_law(state, p, targets, dt)
        else:
            follow_lag(state, p, targets, decay_up, decay_down, dt)
        return
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
