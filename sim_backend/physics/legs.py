"""Four sprung legs with adhesive feet.

A leg is massless: a rod from the hip, held by a torsional spring and damper that is equally stiff for any
bending, stiff along its axis. A foot that touches is a ball joint at its anchor; the rod then points from the
hip to the anchor, and the force on the foot follows from the moments about the hip (docs/physics.md, Legs).
The wrench on the body is that force, acting at the anchor.
"""

import math
from typing import Any

from onboard.arrays import Vector
from sim_backend.physics.jit import kernel
from sim_backend.physics.motors import Wrench
from sim_backend.physics.state import FootMode

FREE = int(FootMode.FREE)
PRESSING_CEILING = int(FootMode.PRESSING_CEILING)
PRESSING_FLOOR = int(FootMode.PRESSING_FLOOR)
ATTACHED = int(FootMode.ATTACHED)
RELEASED = int(FootMode.RELEASED)

CLEARANCE = 5e-4
"""m: a foot that was torn off may touch again once its rest position is this far below the ceiling."""


@kernel
def bending(p: Any, leg: int, ux: float, uy: float, uz: float) -> tuple[float, float, float, float]:
    """Bending angle (rad) of a leg along the unit vector u (body frame), and its axis (unit, body frame)."""
    rx, ry, rz = p.leg_direction[leg, 0], p.leg_direction[leg, 1], p.leg_direction[leg, 2]
    nx, ny, nz = ry * uz - rz * uy, rz * ux - rx * uz, rx * uy - ry * ux
    sine = math.sqrt(nx * nx + ny * ny + nz * nz)
    if sine < 1e-12:
        return 0.0, 0.0, 0.0, 0.0
    angle = math.atan2(sine, rx * ux + ry * uy + rz * uz)
    return angle, nx / sine, ny / sine, nz / sine


@kernel
def hinge_moment(p: Any, angle: float) -> float:
    """Restoring moment (N m) of the hinge spring and, beyond the limit, of its stop."""
    moment = p.hinge_stiffness * angle
    if angle > p.hinge_limit:
        moment += p.hinge_limit_stiffness * (angle - p.hinge_limit)
    return moment


@kernel
def hinge_energy(p: Any, angle: float) -> float:
    """Energy (J) in the hinge spring and its stop."""
    energy = 0.5 * p.hinge_stiffness * angle * angle
    if angle > p.hinge_limit:
        energy += 0.5 * p.hinge_limit_stiffness * (angle - p.hinge_limit) ** 2
    return energy


@kernel
def foot_force(
    p: Any, leg: int, px: float, py: float, pz: float, vx: float, vy: float, vz: float,
    wx: float, wy: float, wz: float,
) -> Vector:  # fmt: skip
    """Force (N, body frame) of the surface on a foot held at p (m, body frame).

    Args:
        p: parameters.
        leg: index 0..3.
        px, py, pz: anchor relative to the body origin, body frame.
        vx, vy, vz: velocity of the body, body frame (m/s).
        wx, wy, wz: body rate (rad/s).
    """
    rx, ry, rz = px - p.hip[leg, 0], py - p.hip[leg, 1], pz - p.hip[leg, 2]
    length = math.sqrt(rx * rx + ry * ry + rz * rz)
    inverse = 1.0 / length
    ux, uy, uz = rx * inverse, ry * inverse, rz * inverse
    # The anchor rests in the world: seen from the body it moves with -(v + w x p).
    dx, dy, dz = -(vx + wy * pz - wz * py), -(vy + wz * px - wx * pz), -(vz + wx * py - wy * px)
    stretch_rate = dx * ux + dy * uy + dz * uz
    angle, nx, ny, nz = bending(p, leg, ux, uy, uz)
    moment = hinge_moment(p, angle)
    damping = p.hinge_damping * inverse
    # Moment of hinge spring and damper on the leg; the leg turns with u x d / length.
    tx = -moment * nx - damping * (uy * dz - uz * dy)
    ty = -moment * ny - damping * (uz * dx - ux * dz)
    tz = -moment * nz - damping * (ux * dy - uy * dx)
    axial = p.axial_stiffness * (length - p.leg_length) + p.axial_damping * stretch_rate
    return (
        (uy * tz - uz * ty) * inverse + axial * ux,
        (uz * tx - ux * tz) * inverse + axial * uy,
        (ux * ty - uy * tx) * inverse + axial * uz,
    )


@kernel
def limit_friction(p: Any, state: Any, leg: int, fx: float, fy: float, push: float) -> tuple[float, float]:
    """Horizontal force (N, world) within the friction cone of a pressing foot; beyond it the anchor slides.

    The slide relaxes the excess over a few steps through the stiffest direction of the leg.
    """
    size = math.hypot(fx, fy)
    limit = p.foot_friction * push
    if size <= limit:
        return fx, fy
    slide = 0.5 * (size - limit) / (p.axial_stiffness * size)
    state.foot_anchor[leg, 0] -= slide * fx
    state.foot_anchor[leg, 1] -= slide * fy
    return fx * limit / size, fy * limit / size


@kernel
def hold_foot(p: Any, state: Any, leg: int, fx: float, fy: float, fz: float) -> Wrench:
    """Decide what a touching foot can hold of the force (N, world) that would keep it at its anchor.

    Returns the force that acts (first three entries) and changes the foot's mode.
    """
    mode = state.foot_mode[leg]
    if mode == ATTACHED:
        if fz > p.adhesion_strength:
            state.foot_mode[leg] = RELEASED
            state.foot_attached[leg] = 0
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        return fx, fy, fz, 0.0, 0.0, 0.0
    push = fz if mode == PRESSING_FLOOR else -fz
    if push <= 0.0:
        state.foot_mode[leg] = FREE
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if mode == PRESSING_CEILING and push >= p.minimum_preload:
        state.foot_mode[leg] = ATTACHED
        state.foot_attached[leg] = 1
        return fx, fy, fz, 0.0, 0.0, 0.0
    fx, fy = limit_friction(p, state, leg, fx, fy, push)
    return fx, fy, fz, 0.0, 0.0, 0.0
