"""velocity_moment: flying turns the vehicle, tau_x = roll u_y, tau_y = -pitch u_x.

Positive values raise the edge that goes first, as do blade flapping and a centre of drag above the centre of
mass (Mahony, Kumar, Corke 2012).
"""

from collections.abc import Mapping
from typing import Any

from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import inner


@inner
def velocity_moment(p: Any, ux: float, uy: float) -> tuple[float, float]:
    """Torque (N m) about b_x and b_y at a velocity through the air (m/s, body frame)."""
    return p.velocity_moment[0] * uy, -p.velocity_moment[1] * ux


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["velocity_moment"] = [values["roll"], values["pitch"]]


EFFECT = EffectTerm("velocity_moment", Acts.FORCES, _apply, (Field("velocity_moment", (2,)),))
