"""body_drag: quadratic drag of the body, f_k = -1/2 rho area_k |u| u_k along each body axis.

`area_k` is the drag coefficient times the area seen along that axis. The force acts at the centre of mass;
a centre of drag above it is velocity_moment.
"""

import math
from collections.abc import Mapping
from typing import Any

from onboard.arrays import Vector
from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import inner

AIR_DENSITY = 1.2
"""kg/m3, at 20 deg C and 1010 hPa."""


@inner
def body_drag(p: Any, ux: float, uy: float, uz: float) -> Vector:
    """Force (N, body frame) at a velocity through the air (m/s, body frame)."""
    speed = math.sqrt(ux * ux + uy * uy + uz * uz)
    drag = p.quadratic_drag
    return -drag[0] * speed * ux, -drag[1] * speed * uy, -drag[2] * speed * uz


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["quadratic_drag"] = [0.5 * AIR_DENSITY * values[f"area_{axis}"] for axis in "xyz"]


EFFECT = EffectTerm("body_drag", Acts.FORCES, _apply, (Field("quadratic_drag", (3,)),))
