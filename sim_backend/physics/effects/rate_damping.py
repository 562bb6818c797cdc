"""rate_damping: the air damps a turn, tau_k = -damping_k w_k about each body axis."""

from collections.abc import Mapping
from typing import Any

from onboard.arrays import Vector
from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import inner


@inner
def damping_torque(p: Any, wx: float, wy: float, wz: float) -> Vector:
    """Torque (N m, body frame) at a body rate (rad/s)."""
    damping = p.rate_damping
    return -damping[0] * wx, -damping[1] * wy, -damping[2] * wz


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["rate_damping"] = [values["x"], values["y"], values["z"]]


EFFECT = EffectTerm("rate_damping", Acts.FORCES, _apply, (Field("rate_damping", (3,)),))
