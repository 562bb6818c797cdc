"""From what the motors are told to what they head for: bent map, gains, warmth, limit, delay."""

from typing import Any

from onboard.mixer import Thrusts
from sim_backend.physics.effects.command_delay import STEP, delayed
from sim_backend.physics.effects.motor_warming import warmed
from sim_backend.physics.effects.thrust_curve import bent
from sim_backend.physics.jit import outlined


def set_step(p: Any, step: float) -> None:
    """Have effects with a memory take each call of :func:`command_with_effects` for `step` (s), not for the
    1 ms of the simulation.

    Args:
        p: record of parameters as a vehicle file gives them, changed in place.
        step: s.
    """
    p["delay_steps"] *= STEP / step
    p["warming_per_step"] *= step / STEP


@outlined
def command_with_effects(state: Any, p: Any, targets: Thrusts) -> Thrusts:
    """Thrusts (N) that the motors head for in this step when they are told `targets` (N)."""
    gain, most = p.command_gain, p.thrust_limit
    targets = (
        gain[0] * bent(p, targets[0]),
        gain[1] * bent(p, targets[1]),
        gain[2] * bent(p, targets[2]),
        gain[3] * bent(p, targets[3]),
    )
    if p.warming_per_step > 0.0:
        targets = warmed(state, p, targets)
    targets = (
        min(targets[0], most),
        min(targets[1], most),
        min(targets[2], most),
        min(targets[3], most),
    )
    return delayed(state, p, targets) if p.delay_steps > 0.0 else targets
