"""motor_warming: motors that have stood give more than warm ones, F = F* (1 + loss c).

c is 1 in motors that have stood for long and 0 in a long hover, the state that a vehicle file describes:
time_constant dc/dt = 1 - (F / F_hover)^2 - c. A winding is heated by the square of its current, and the
current goes with the thrust. F_hover is a quarter of the weight in the vehicle file.
"""

from collections.abc import Mapping
from typing import Any

from onboard.mixer import Thrusts
from sim_backend.physics.effects.command_delay import STEP
from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import inner


@inner
def warmed(state: Any, p: Any, targets: Thrusts) -> Thrusts:
    """Thrusts (N) that motors as warm as these head for; warms them for a step: to be called once a step."""
    cold, thrust, per_hover = state.coldness, state.thrust, 1.0 / p.hover_thrust
    for motor in range(4):
        load = thrust[motor] * per_hover
        cold[motor] += p.warming_per_step * (1.0 - load * load - cold[motor])
    return (
        targets[0] * (1.0 + p.warming_loss * cold[0]),
        targets[1] * (1.0 + p.warming_loss * cold[1]),
        targets[2] * (1.0 + p.warming_loss * cold[2]),
        targets[3] * (1.0 + p.warming_loss * cold[3]),
    )


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["warming_loss"] = values["loss"]
    p["warming_per_step"] = STEP / values["time_constant"]


EFFECT = EffectTerm("motor_warming", Acts.COMMAND, _apply, (Field("warming_loss"), Field("warming_per_step")))
