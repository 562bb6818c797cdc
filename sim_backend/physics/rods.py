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
from onboard.jit import kernel

Rod = tuple[float, float, float, float, float, float, float]
"""(u, p x u, stretch): direction of a rod, moment arm of a force along it, stretch (m); body frame."""

Inverse = tuple[float, float, float, float]
"""1/mass (1/kg) and one over the three moments of inertia (1/(kg m2))."""

Four = tuple[float, float, float, float]

LOOSE: Rod = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""A rod whose foot is free."""


@kernel
def coupling(a: Rod, b: Rod, inverse: Inverse) -> float:
    """J_a M^-1 J_b^T (1/kg)."""
    return (
        inverse[0] * (a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
        + inverse[1] * a[3] * b[3]
        + inverse[2] * a[4] * b[4]
        + inverse[3] * a[5] * b[5]
    )


@kernel
def stretch_rate(rod: Rod, v: Vector, w: Vector) -> float:
    """Rate (m/s) at which a rod gets longer: its foot rests, its hip moves with the body (body frame)."""
    return -(rod[0] * v[0] + rod[1] * v[1] + rod[2] * v[2] + rod[3] * w[0] + rod[4] * w[1] + rod[5] * w[2])


@kernel
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
    # (1 + h A) f = k s + g s'_0, by L D L^T.
    a00 = 1.0 + h * coupling(a, a, inverse)
    a10, a11 = h * coupling(b, a, inverse), 1.0 + h * coupling(b, b, inverse)
    a20, a21 = h * coupling(c, a, inverse), h * coupling(c, b, inverse)
    a22 = 1.0 + h * coupling(c, c, inverse)
    a30, a31 = h * coupling(d, a, inverse), h * coupling(d, b, inverse)
    a32, a33 = h * coupling(d, c, inverse), 1.0 + h * coupling(d, d, inverse)
    i0 = 1.0 / a00
    l10, l20, l30 = a10 * i0, a20 * i0, a30 * i0
    i1 = 1.0 / (a11 - l10 * a10)
    b21, b31 = a21 - l20 * a10, a31 - l30 * a10
    l21, l31 = b21 * i1, b31 * i1
    i2 = 1.0 / (a22 - l20 * a20 - l21 * b21)
    b32 = a32 - l30 * a20 - l31 * b21
    l32 = b32 * i2
    i3 = 1.0 / (a33 - l30 * a30 - l31 * b31 - l32 * b32)
    y0 = k * a[6] + g * stretch_rate(a, v, w)
    y1 = k * b[6] + g * stretch_rate(b, v, w) - l10 * y0
    y2 = k * c[6] + g * stretch_rate(c, v, w) - l20 * y0 - l21 * y1
    y3 = k * d[6] + g * stretch_rate(d, v, w) - l30 * y0 - l31 * y1 - l32 * y2
    f3 = y3 * i3
    f2 = y2 * i2 - l32 * f3
    f1 = y1 * i1 - l21 * f2 - l31 * f3
    f0 = y0 * i0 - l10 * f1 - l20 * f2 - l30 * f3
    return f0, f1, f2, f3
