"""wind: the air moves, and all its forces see the velocity u = v - wind (constant in the world)."""

from collections.abc import Mapping
from typing import Any

from onboard.arrays import Vector
from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.frames import Rotation, to_body
from sim_backend.physics.jit import inner


@inner
def through_the_air(p: Any, rot: Rotation, vx: float, vy: float, vz: float) -> Vector:
    """Velocity through the air (m/s, body frame) for a velocity in the body frame (m/s)."""
    wx, wy, wz = to_body(rot, p.wind[0], p.wind[1], p.wind[2])
    return vx - wx, vy - wy, vz - wz


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["wind"] = [values["x"], values["y"], values["z"]]


EFFECT = EffectTerm("wind", Acts.FORCES, _apply, (Field("wind", (3,)),))
