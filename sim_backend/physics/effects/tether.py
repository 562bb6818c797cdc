"""tether: a soft string from the centre of mass to a point a of the room.

T = stiffness (|a - p| - length) + damping d|a - p|/dt towards a while the string is taut; it never pushes.
"""

import math
from collections.abc import Mapping
from typing import Any

from onboard.arrays import Vector
from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import inner


@inner
def tether_force(state: Any, p: Any) -> Vector:
    """Force (N, world) of the string; none without it."""
    if p.tether_stiffness == 0.0 and p.tether_damping == 0.0:
        return 0.0, 0.0, 0.0
    position, velocity = state.position, state.velocity
    dx = p.tether_anchor[0] - position[0]
    dy = p.tether_anchor[1] - position[1]
    dz = p.tether_anchor[2] - position[2]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    if distance <= p.tether_length or distance == 0.0:
        return 0.0, 0.0, 0.0
    rate = -(dx * velocity[0] + dy * velocity[1] + dz * velocity[2]) / distance
    tension = p.tether_stiffness * (distance - p.tether_length) + p.tether_damping * rate
    pull = max(tension, 0.0) / distance
    return pull * dx, pull * dy, pull * dz


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["tether_anchor"] = [values["x"], values["y"], values["z"]]
    p["tether_length"] = values["length"]
    p["tether_stiffness"], p["tether_damping"] = values["stiffness"], values["damping"]


EFFECT = EffectTerm(
    "tether",
    Acts.FORCES,
    _apply,
    (
        Field("tether_anchor", (3,)),
        Field("tether_length"),
        Field("tether_stiffness"),
        Field("tether_damping"),
    ),
)
