"""Four sprung legs: geometry, hinge, and the force of a leg whose foot is held.

A leg is massless: a rod from the hip, held by a torsional spring and damper that is equally stiff for any
bending, stiff along its axis. A foot that touches is a ball joint at its anchor; the rod then points from the
hip to the anchor, and the force on the foot follows from the moments about the hip (docs/physics.md, Legs).
Across the rod it is the hinge's (:func:`hinge_force`); along the rod it is the much stiffer rod's own, which
:mod:`sim_backend.physics.rods` finds for all legs together.
"""

import math
from typing import Any

import numpy as np

from onboard.arrays import Vector
from sim_backend.physics.effects.leg_sideways import sideways_force
from sim_backend.physics.jit import inner

_POLYNOMIAL_END = 0.5


def _ratio_polynomial() -> tuple[float, ...]:
    """Coefficients, highest power first, of delta / sin(delta) in 1 - cos(delta); 1e-10 up to 60 deg."""
    x = np.polynomial.chebyshev.chebpts1(40) * 0.5 * _POLYNOMIAL_END + 0.5 * _POLYNOMIAL_END
    delta = 2.0 * np.arcsin(np.sqrt(0.5 * x))
    fit = np.polynomial.Polynomial.fit(x, delta / np.sin(delta), 8, domain=[0.0, _POLYNOMIAL_END])
    return tuple(float(c) for c in fit.convert().coef[::-1])


_RATIO = _ratio_polynomial()


@inner
def bending_ratio(cosine: float) -> float:
    """Bending angle over its sine, from its cosine; a polynomial up to 60 deg, where legs mostly are."""
    x = 1.0 - cosine
    if x > _POLYNOMIAL_END:
        sine = math.sqrt(max(1.0 - cosine * cosine, 1e-24))
        return math.atan2(sine, cosine) / sine
    ratio = _RATIO[0]
    for k in range(1, len(_RATIO)):
        ratio = ratio * x + _RATIO[k]
    return ratio


@inner
def hinge_force(p: Any, leg: int, u: Vector, inverse: float, d: Vector) -> Vector:
    """Force (N, body frame) on a held foot across its rod, by the hinge's spring and damper.

    The spring's moment K delta about u x r and the damper's -c u x d / L, both over the lever L; and what a
    second axis adds (``leg_sideways``).

    Args:
        p: parameters.
        leg: index 0..3.
        u: unit vector from hip to foot, body frame.
        inverse: 1/m, one over the distance L of hip and foot.
        d: velocity of the foot as seen from the body (m/s, body frame).
    """
    rx, ry, rz = p.leg_direction[leg, 0], p.leg_direction[leg, 1], p.leg_direction[leg, 2]
    cosine = rx * u[0] + ry * u[1] + rz * u[2]
    ratio = bending_ratio(cosine)
    moment = p.hinge_stiffness * ratio
    if cosine < p.hinge_limit_cosine:
        # K_stop (delta - limit) / sin(delta)
        sine = math.sqrt(max(1.0 - cosine * cosine, 1e-24))
        moment += p.hinge_limit_stiffness * (ratio - p.hinge_limit / sine)
    along = u[0] * d[0] + u[1] * d[1] + u[2] * d[2]
    spring, damper = moment * inverse, p.hinge_damping * inverse * inverse
    x = damper * (d[0] - along * u[0]) - spring * (rx - cosine * u[0])
    y = damper * (d[1] - along * u[1]) - spring * (ry - cosine * u[1])
    z = damper * (d[2] - along * u[2]) - spring * (rz - cosine * u[2])
    if p.sideways_stiffness != 0.0 or p.sideways_damping != 0.0:
        more = sideways_force(p, leg, u, inverse, d)
        return x + more[0], y + more[1], z + more[2]
    return x, y, z
