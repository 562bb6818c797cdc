"""leg_sideways: a hinge of two axes, across the leg's plane stiffer or softer than in it, and so its damper.

The leg's plane holds b_z and the rod at rest, s is its normal. A rod along the unit vector u leans out of it
by beta = asin(u . s). Beside spring and damper that are alike for any bending (:mod:`..legs`) the hinge has

    V = (stiffness - 1) K beta^2 / 2,    power lost = (damping - 1) c (d beta/dt)^2

so that a bend in the plane meets K and c, one across it stiffness K and damping c. The whole bend is at least
beta, and the rod's turn at least d beta/dt: energy and loss are never negative, whatever the two ratios. The
stop is for the whole bend, as without the effect.

A strip that bends is softer about the axis of its width, by the square of width over thickness. The authors'
simulated hinge is two axes of the same K and c, the second inclined by 45 deg to the leg: an axis that must
turn by beta / sin 45 deg, so that both ratios are 2 (docs/physics.md).
"""

import math
from collections.abc import Mapping
from typing import Any

from onboard.arrays import Vector
from sim_backend.physics.effects.term import Acts, EffectTerm, Field
from sim_backend.physics.jit import outlined


def _apply(p: Any, values: Mapping[str, float]) -> None:
    p["sideways_stiffness"] = values["stiffness"] - 1.0
    p["sideways_damping"] = values["damping"] - 1.0


EFFECT = EffectTerm(
    "leg_sideways", Acts.ONCE, _apply, (Field("sideways_stiffness"), Field("sideways_damping"))
)


@outlined
def sideways_force(p: Any, leg: int, u: Vector, inverse: float, d: Vector) -> Vector:
    """What the second axis adds to the force (N, body frame) on a held foot across its rod.

    Args:
        p: parameters.
        leg: index 0..3.
        u: unit vector from hip to foot, body frame.
        inverse: 1/m, one over the distance L of hip and foot.
        d: velocity of the foot as seen from the body (m/s, body frame).
    """
    sx, sy = p.leg_sideways[leg, 0], p.leg_sideways[leg, 1]
    sine = u[0] * sx + u[1] * sy
    cosine = math.sqrt(max(1.0 - sine * sine, 1e-12))
    # The gradient of beta, times L: the part of s across the rod, of length cos(beta), over cos(beta).
    x, y, z = (sx - sine * u[0]) / cosine, (sy - sine * u[1]) / cosine, -sine * u[2] / cosine
    spring = p.sideways_stiffness * p.hinge_stiffness * math.atan2(sine, cosine)
    damper = p.sideways_damping * p.hinge_damping * (d[0] * x + d[1] * y + d[2] * z) * inverse
    force = (spring + damper) * inverse
    return force * x, force * y, force * z
