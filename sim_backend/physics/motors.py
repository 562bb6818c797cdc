"""Motors with propellers: first-order thrust with time constants up and down, arms and drag torque.

Effects (delay, gains, speed law ...) come in by one test each; a vehicle without them does not pay for them.
"""

import math
from typing import Any

from onboard.mixer import Thrusts
from sim_backend.physics.effects.command import command_with_effects
from sim_backend.physics.effects.motor_speed_law import speed_after
from sim_backend.physics.frames import Wrench
from sim_backend.physics.jit import inner, outlined

SETTLED = 1e-15
"""N: a thrust this close to its target is there; a stopped motor would decay into slow denormal numbers."""

STOPPED = 1e-6
"""rad/s: likewise, a rotor this slow stands."""


@inner
def decay(p: Any, dt: float) -> tuple[float, float]:
    """What is left of a thrust error after `dt` (s), for a rising and a falling thrust: exp(-dt / tau)."""
    return math.exp(-dt / p.time_constant_up), math.exp(-dt / p.time_constant_down)


@inner
def lag(thrust: float, target: float, decay_up: float, decay_down: float) -> float:
    """Thrust (N) of one motor after the time that belongs to the decays; exact for a constant target."""
    error = thrust - target
    if abs(error) < SETTLED:
        return target
    return target + error * (decay_up if error < 0.0 else decay_down)


@inner
def commanded(state: Any, p: Any, targets: Thrusts) -> Thrusts:
    """What the motors head for (N) in this step when they are told `targets`: to be called once a step."""
    if p.command_on:
        return command_with_effects(state, p, targets)
    return targets


@inner
def lag_all(state: Any, targets: Thrusts, decay_up: float, decay_down: float) -> None:
    """Advance the four thrusts of the state towards their targets (N), each as :func:`lag`."""
    thrust = state.thrust
    thrust[0] = lag(thrust[0], targets[0], decay_up, decay_down)
    thrust[1] = lag(thrust[1], targets[1], decay_up, decay_down)
    thrust[2] = lag(thrust[2], targets[2], decay_up, decay_down)
    thrust[3] = lag(thrust[3], targets[3], decay_up, decay_down)


@inner
def rotor_speed(state: Any, p: Any, motor: int) -> float:
    """Speed (rad/s) of a rotor: from its thrust, unless a speed law left it in the state."""
    thrust, kept = state.thrust[motor], state.rotor_speed[motor]
    if kept * kept * p.thrust_per_speed2 == thrust:
        return kept
    return math.sqrt(thrust * p.speed2_per_thrust)


@outlined
def speed_law_to_middle(state: Any, p: Any, targets: Thrusts, half: float) -> None:
    """The first half of a step by the speed law; keeps what the second half and the torque need."""
    thrust, per_time = state.thrust, 0.5 / half
    for motor in range(4):
        rising = targets[motor] > thrust[motor]
        a = p.speed_law_a[0] if rising else p.speed_law_a[1]
        b = p.speed_law_b[0] if rising else p.speed_law_b[1]
        settled = math.sqrt(targets[motor] * p.speed2_per_thrust)
        start = rotor_speed(state, p, motor)
        middle = speed_after(start, settled, a, b, half)
        end = speed_after(start, settled, a, b, 2.0 * half)
        state.rotor_speed[motor] = middle
        state.speed_ahead[motor] = end if end > STOPPED else 0.0
        thrust[motor] = middle * middle * p.thrust_per_speed2
        state.rotor_acceleration[motor] = (end - start) * per_time


@outlined
def mean_acceleration(
    state: Any, p: Any, targets: Thrusts, decay_up: float, decay_down: float, half: float
) -> None:
    """Mean acceleration (rad/s2) of the rotors over a step that begins now, for first-order thrusts."""
    thrust, per_time = state.thrust, 0.5 / half
    for motor in range(4):
        start, target = thrust[motor], targets[motor]
        end = lag(lag(start, target, decay_up, decay_down), target, decay_up, decay_down)
        change = math.sqrt(end * p.speed2_per_thrust) - math.sqrt(start * p.speed2_per_thrust)
        state.rotor_acceleration[motor] = change * per_time


@inner
def lag_to_middle(
    state: Any, p: Any, targets: Thrusts, decay_up: float, decay_down: float, half: float
) -> None:
    """Advance the thrusts of the state over the first half of a step, where the forces are taken.

    Args:
        state: record, changed in place.
        p: record of parameters.
        targets: from :func:`commanded`.
        decay_up, decay_down: from :func:`decay` for `half`.
        half: s, half of the step.
    """
    if p.motors_on:
        if p.speed_law_b[0] > 0.0:
            speed_law_to_middle(state, p, targets, half)
            return
        mean_acceleration(state, p, targets, decay_up, decay_down, half)
    lag_all(state, targets, decay_up, decay_down)


@inner
def lag_to_end(state: Any, p: Any, targets: Thrusts, decay_up: float, decay_down: float) -> None:
    """Advance the thrusts over the second half of the step that :func:`lag_to_middle` began."""
    if p.speed_law_b[0] > 0.0:
        for motor in range(4):
            end = state.speed_ahead[motor]
            state.rotor_speed[motor] = end
            state.thrust[motor] = end * end * p.thrust_per_speed2
        return
    lag_all(state, targets, decay_up, decay_down)


@inner
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
