"""Mechanical energy of a state: what the invariants are about."""

import math
from typing import Any

from sim_backend.physics.feet import can_touch
from sim_backend.physics.frames import to_body
from sim_backend.physics.jit import inner, kernel
from sim_backend.physics.step import attitude


@inner
def bending(p: Any, leg: int, ux: float, uy: float, uz: float) -> tuple[float, float, float, float]:
    """Bending angle (rad) of a leg along the unit vector u (body frame), and its axis (unit, body frame)."""
    rx, ry, rz = p.leg_direction[leg, 0], p.leg_direction[leg, 1], p.leg_direction[leg, 2]
    nx, ny, nz = ry * uz - rz * uy, rz * ux - rx * uz, rx * uy - ry * ux
    sine = math.sqrt(nx * nx + ny * ny + nz * nz)
    if sine < 1e-12:
        return 0.0, 0.0, 0.0, 0.0
    angle = math.atan2(sine, rx * ux + ry * uy + rz * uz)
    return angle, nx / sine, ny / sine, nz / sine


@inner
def hinge_energy(p: Any, angle: float) -> float:
    """Energy (J) in the hinge spring and its stop."""
    energy = 0.5 * p.hinge_stiffness * angle * angle
    if angle > p.hinge_limit:
        energy += 0.5 * p.hinge_limit_stiffness * (angle - p.hinge_limit) ** 2
    return energy


@inner
def sideways_energy(p: Any, leg: int, ux: float, uy: float) -> float:
    """Energy (J) that a hinge of two axes has besides, of a leg along the unit vector u (body frame)."""
    sine = ux * p.leg_sideways[leg, 0] + uy * p.leg_sideways[leg, 1]
    beta = math.asin(min(max(sine, -1.0), 1.0))
    return 0.5 * p.sideways_stiffness * p.hinge_stiffness * beta * beta


@inner
def spring_energy(state: Any, p: Any) -> float:
    """Energy (J) in hinges and legs of the feet that touch."""
    rot = attitude(state)
    energy = 0.0
    for leg in range(4):
        if can_touch(state.foot_mode[leg]):
            continue
        anchor, position = state.foot_anchor[leg], state.position
        px, py, pz = to_body(rot, anchor[0] - position[0], anchor[1] - position[1], anchor[2] - position[2])
        rx, ry, rz = px - p.hip[leg, 0], py - p.hip[leg, 1], pz - p.hip[leg, 2]
        length = (rx * rx + ry * ry + rz * rz) ** 0.5
        angle = bending(p, leg, rx / length, ry / length, rz / length)[0]
        energy += hinge_energy(p, angle) + sideways_energy(p, leg, rx / length, ry / length)
        energy += 0.5 * p.axial_stiffness * (length - p.leg_length) ** 2
    return energy


@kernel
def mechanical_energy(state: Any, p: Any) -> float:
    """Kinetic, potential (zero at the floor) and spring energy (J)."""
    kinetic = 0.0
    for axis in range(3):
        kinetic += 0.5 * p.mass * state.velocity[axis] ** 2 + 0.5 * p.inertia[axis] * state.omega[axis] ** 2
    return kinetic + p.mass * p.gravity * state.position[2] + spring_energy(state, p)
