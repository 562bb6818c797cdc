"""command_delay: what the motors are told reaches them late, F*(t) -> F*(t - delay).

The commands of the last steps are kept in a ring in the state, so that the delay counts in steps of 1 ms. A
delay between two steps mixes the two commands, which is their mean over the step.
"""

from collections.abc import Mapping
from typing import Any

from onboard.mixer import Thrusts
from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import kernel
from sim_backend.physics.state import COMMAND_MEMORY

STEP = 1e-3
"""s, step of the physics everywhere in perchhw."""


@kernel
def delayed(state: Any, p: Any, targets: Thrusts) -> Thrusts:
    """The command (N) that reaches the motors in this step; to be called once a step.

    Until the first command arrives a motor keeps the thrust that it has.
    """
    memory, thrust = state.command_memory, state.thrust
    now = state.command_count
    state.command_count = now + 1
    slot = now % COMMAND_MEMORY
    memory[slot, 0], memory[slot, 1], memory[slot, 2], memory[slot, 3] = targets
    steps = int(p.delay_steps)
    part = p.delay_steps - steps
    if now < steps:
        return thrust[0], thrust[1], thrust[2], thrust[3]
    young = (now - steps) % COMMAND_MEMORY
    old = young if now == steps or part == 0.0 else (now - steps - 1) % COMMAND_MEMORY
    return (
        memory[young, 0] + part * (memory[old, 0] - memory[young, 0]),
        memory[young, 1] + part * (memory[old, 1] - memory[young, 1]),
        memory[young, 2] + part * (memory[old, 2] - memory[young, 2]),
        memory[young, 3] + part * (memory[old, 3] - memory[young, 3]),
    )


def _apply(p: Any, values: Mapping[str, float]) -> None:
    # Rounded so that a whole number of steps stays one: 0.007 / 0.001 is not 7.
    p["delay_steps"] = round(values["delay"] / STEP, 6)


EFFECT = EffectTerm("command_delay", Acts.COMMAND, _apply, (Field("delay_steps"),))
