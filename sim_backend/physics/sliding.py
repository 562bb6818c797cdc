"""Friction of a foot that presses without adhering: how far it slides within a step, and the force then.

A foot slides as soon as the force that would keep it in place leaves the Coulomb cone. It slides by s
against the friction, just as far as brings the force back to the cone, normal and friction force falling
together. A spring then never keeps energy that the body has not paid for (a force that is only cut to the
cone would let it).
"""

import math

from onboard.arrays import Vector
from sim_backend.physics.jit import inner

BISECTIONS = 40
"""Halvings of the longest slide, some centimetres: down to the last bit that matters."""

Slide = tuple[Vector, float, float]
"""Force on the foot (N, world) and how far it slides in x and y (m); a force of zero: it came off."""


@inner
def slip(friction: float, a: float, b: float, push: float, stiff: Vector) -> Vector:
    """Slide s (m) and the two parts of the friction (N), both zero when the push is gone before it stops.

    With the friction m e (unit vector e, size m = friction x push'), s solves

        a = (m + s A) e_a,   b = (m + s B) e_b,   push' = push - s C e_a,   |e| = 1

    by bisection, e and m being in closed form for a given s.

    Args:
        friction: coefficient, > 0.
        a, b: force if the foot rested (N), along the rod's shadow on the plane and across it.
        push: N, likewise.
        stiff: (A, B, C): how much a, b and the push fall per slide (N/m); A, B > 0.
    """
    along, across, normal = stiff
    low, high = 0.0, math.hypot(a, b) / across
    s, fa, fb, off = high, 0.0, 0.0, False
    for _ in range(BISECTIONS):
        s = 0.5 * (low + high)
        # m + s A from its quadratic equation; no solution: the push is gone.
        total = s * along + friction * push
        root = total * total - 4.0 * friction * s * normal * a
        whole = 0.5 * (total + math.sqrt(max(root, 0.0)))
        size = whole - s * along
        if root < 0.0 or size <= 0.0:
            high, off = s, True
            continue
        ea, eb = a / whole, b / (size + s * across)
        fa, fb = size * ea, size * eb
        if ea * ea + eb * eb > 1.0:
            low = s
        else:
            high, off = s, False
    return (s, 0.0, 0.0) if off else (s, fa, fb)


@inner
def slide(friction: float, force: Vector, sign: float, u: Vector, across: float, along: float) -> Slide:
    """What a surface does to a foot that presses against it.

    Args:
        friction: coefficient, > 0.
        force: on the foot if it rested (N, world).
        sign: +1 on the floor, -1 on the ceiling; sign x force_z > 0.
        u: direction of the rod, world.
        across, along: how much the force falls per slide within this step, across and along the rod (N/m).
    """
    push = sign * force[2]
    if math.hypot(force[0], force[1]) <= friction * push:
        return force, 0.0, 0.0
    shadow = math.hypot(u[0], u[1])
    x, y = (u[0] / shadow, u[1] / shadow) if shadow > 1e-9 else (1.0, 0.0)
    a, b = x * force[0] + y * force[1], x * force[1] - y * force[0]
    extra = along - across
    normal = sign * extra * shadow * u[2]
    s, fa, fb = slip(friction, a, b, push, (across + extra * shadow * shadow, across, normal))
    size = math.hypot(fa, fb)
    if size == 0.0:
        return (0.0, 0.0, 0.0), 0.0, 0.0
    fx, fy = x * fa - y * fb, y * fa + x * fb
    return (fx, fy, sign * size / friction), -s * fx / size, -s * fy / size
