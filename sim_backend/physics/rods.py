"""Forces along the rods of the legs whose feet are held, found for all legs together.

A rod is so stiff (k) and damped (c) that an explicit step of 1 ms would explode. Its force is therefore the
one that belongs to the end of the step (backward Euler): with the stretch s at the middle of the step and its
rate s' after it,

    f = k (s + s' dt / 2) + c s',    s'_i = s'_i0 - dt sum_j A_ij f_j,    A_ij = J_i M^-1 J_j^T,

where J = (u, p x u) takes a force along rod u at the foot p to force and moment on the body. This gives a
symmetric positive definite system of four unknowns, for any stiffness; a rod that holds nothing has J = 0.
"""

from typing import Any

from onboard.arrays import Vector
from sim_backend.physics.jit import inner

Rod = tuple[float, float, float, float, float, float, float]
"""(u, p x u, stretch): direction of a rod, moment arm of a force along it, stretch (m); body frame."""

Inverse = tuple[float, float, float, float]
"""1/mass (1/kg) and one over the three moments of inertia (1/(kg m2))."""

Four = tuple[float, float, float, float]

LOOSE: Rod = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""A rod whose foot is free."""


@inner
def coupling(a: Rod, b: Rod, inverse: Inverse) -> float:
    """J_a M^-1 J_b^T (1/kg)."""
    return (
        inverse[0] * (a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
        + inverse[1] * a[3] * b[3]
        + inverse[2] * a[4] * b[4]
        + inverse[3] * a[5] * b[5]
    )


@inner
def stretch_rate(rod: Rod, v: Vector, w: Vector) -> float:
    """Rate (m/s) at which a rod gets longer: its foot rests, its hip moves with the body (body frame)."""
    return -(rod[0] * v[0] + rod[1] * v[1] + rod[2] * v[2] + rod[3] * w[0] + rod[4] * w[1] + rod[5] * w[2])


@inner
def rod_forces(
    p: Any, inverse: Inverse, a: Rod, b: Rod, c: Rod, d: Rod, v: Vector, w: Vector, dt: float
) -> Four:
    """Pulls (N, positive: the rod is stretched) of the four rods on the body over a step of `dt` (s).

    Args:
        p: parameters. inverse: its inverse mass and inertias.
        a, b, c, d: the rods of legs 1 to 4 in the middle of the step; LOOSE where the foot is free.
        v, w: velocity (m/s) and rate (rad/s) of the body after the step without these forces, body frame.
        dt: s.
    """
    k, g = p.axial_stiffness, p.axial_damping + 0.5 * dt * p.axial_stiffness
    h = g * dt
    # (1 + h A) f = k s + g s'_0, in blocks of two.
    a00, a10 = 1.0 + h * coupling(a, a, inverse), h * coupling(b, a, inverse)
    a11 = 1.0 + h * coupling(b, b, inverse)
    a20, a21 = h * coupling(c, a, inverse), h * coupling(c, b, inverse)
    a30, a31 = h * coupling(d, a, inverse), h * coupling(d, b, inverse)
    a22, a32 = 1.0 + h * coupling(c, c, inverse), h * coupling(d, c, inverse)
    a33 = 1.0 + h * coupling(d, d, inverse)
    y0, y1 = k * a[6] + g * stretch_rate(a, v, w), k * b[6] + g * stretch_rate(b, v, w)
    y2, y3 = k * c[6] + g * stretch_rate(c, v, w), k * d[6] + g * stretch_rate(d, v, w)
    over = 1.0 / (a00 * a11 - a10 * a10)
    w20, w21 = (a20 * a11 - a21 * a10) * over, (a21 * a00 - a20 * a10) * over
    w30, w31 = (a30 * a11 - a31 * a10) * over, (a31 * a00 - a30 * a10) * over
    s22, s32 = a22 - w20 * a20 - w21 * a21, a32 - w30 * a20 - w31 * a21
    s33 = a33 - w30 * a30 - w31 * a31
    y2 -= w20 * y0 + w21 * y1
    y3 -= w30 * y0 + w31 * y1
    under = 1.0 / (s22 * s33 - s32 * s32)
    f2, f3 = (s33 * y2 - s32 * y3) * under, (s22 * y3 - s32 * y2) * under
    y0 -= a20 * f2 + a30 * f3
    y1 -= a21 * f2 + a31 * f3
    f0, f1 = (a11 * y0 - a10 * y1) * over, (a00 * y1 - a10 * y0) * over
    return f0, f1, f2, f3
