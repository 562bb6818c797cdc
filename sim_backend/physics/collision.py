"""Body and propellers against ceiling and floor: impulses with restitution and Coulomb friction.

The hull is a box (eight corners); a propeller is a disc, of which the highest (ceiling) or lowest (floor)
point counts. All points that move into the plane are treated at once, so that left and right are alike: their
impulses together go as far as takes the most kinetic energy, and (1 + restitution) times as far. The energy
after it is therefore never larger than before, for any set of points.
"""

import math
from typing import Any

import numpy as np

from onboard.arrays import Vector
from sim_backend.physics.frames import Rotation
from sim_backend.physics.jit import inner, kernel

POINTS = 12
"""Eight corners and four propellers."""

REST_SPEED = 0.1
"""m/s: slower impacts do not bounce, so that a body comes to rest."""

PASSES = 2
"""The first pass bounces, the second stops what the first pushed into the plane elsewhere."""


@kernel
def hull_point(p: Any, rot: Rotation, index: int, normal: float) -> Vector:
    """Point `index` that may touch the plane (ceiling: normal -1, floor: +1), body frame, m."""
    sign_x = 1.0 if index & 1 else -1.0
    sign_y = 1.0 if index & 2 else -1.0
    x, y = p.geometric_centre[0], p.geometric_centre[1]
    if index < 8:
        z = p.body_top_z if index & 4 else p.body_bottom_z
        return x + sign_x * p.body_half_x, y + sign_y * p.body_half_y, z
    # The rim's point nearest to the plane lies along the plane's direction, projected on the disc.
    gx, gy = -normal * rot[6], -normal * rot[7]
    size = math.hypot(gx, gy)
    scale = p.rim_radius / size if size > 1e-9 else 0.0
    x, y = x + sign_x * p.arm_x, y + sign_y * p.arm_y
    return x + gx * scale, y + gy * scale, p.propeller_height_z


@kernel
def beyond(state: Any, p: Any, rot: Rotation, point: Vector, normal: float) -> bool:
    """Whether a body point lies beyond the ceiling (normal -1) or below the floor (normal +1)."""
    z = state.position[2] + rot[6] * point[0] + rot[7] * point[1] + rot[8] * point[2]
    return z >= p.ceiling_z if normal < 0.0 else z <= 0.0


@inner
def point_velocity(state: Any, rot: Rotation, b: Vector) -> Vector:
    """Velocity of a body point in the world frame (m/s)."""
    v, w = state.velocity, state.omega
    sx, sy, sz = w[1] * b[2] - w[2] * b[1], w[2] * b[0] - w[0] * b[2], w[0] * b[1] - w[1] * b[0]
    return (
        v[0] + rot[0] * sx + rot[1] * sy + rot[2] * sz,
        v[1] + rot[3] * sx + rot[4] * sy + rot[5] * sz,
        v[2] + rot[6] * sx + rot[7] * sy + rot[8] * sz,
    )


@inner
def lever(rot: Rotation, b: Vector, nx: float, ny: float, nz: float) -> Vector:
    """b x n in the body frame, for a point b (body frame) and a direction n (world frame)."""
    ax = rot[0] * nx + rot[3] * ny + rot[6] * nz
    ay = rot[1] * nx + rot[4] * ny + rot[7] * nz
    az = rot[2] * nx + rot[5] * ny + rot[8] * nz
    return b[1] * az - b[2] * ay, b[2] * ax - b[0] * az, b[0] * ay - b[1] * ax


@inner
def mobility(p: Any, arm: Vector) -> float:
    """Change of a point's velocity per impulse along the direction of its lever (1/kg)."""
    i = p.inertia
    return 1.0 / p.mass + arm[0] * arm[0] / i[0] + arm[1] * arm[1] / i[1] + arm[2] * arm[2] / i[2]


@inner
def apply_impulse(state: Any, p: Any, total: Any, scale: float) -> None:
    """Change the velocities by `scale` times an impulse (N s, world) and an angular impulse (N m s, body)."""
    for axis in range(3):
        state.velocity[axis] += scale * total[axis] / p.mass
        state.omega[axis] += scale * total[3 + axis] / p.inertia[axis]


@inner
def best_scale(p: Any, total: Any, gain: float) -> float:
    """The scale of an impulse that leaves the least kinetic energy; `gain` (J) is what it takes at first."""
    cost = 0.0
    for axis in range(3):
        cost += total[axis] ** 2 / p.mass + total[3 + axis] ** 2 / p.inertia[axis]
    return gain / cost if cost > 0.0 else 0.0


@inner
def push_out(state: Any, p: Any, rot: Rotation, normal: float, pushes: Any, bounce: float) -> None:
    """Normal impulses on all touching points that move inwards; `pushes` receives each of them (N s)."""
    total = np.zeros(6)
    gain, fastest = 0.0, 0.0
    for index in range(POINTS):
        pushes[index] = 0.0
        point = hull_point(p, rot, index, normal)
        if not beyond(state, p, rot, point, normal):
            continue
        into = -normal * point_velocity(state, rot, point)[2]
        if into <= 0.0:
            continue
        arm = lever(rot, point, 0.0, 0.0, normal)
        push = into / mobility(p, arm)
        pushes[index] = push
        total[2] += push * normal
        total[3] += push * arm[0]
        total[4] += push * arm[1]
        total[5] += push * arm[2]
        gain += push * into
        fastest = max(fastest, into)
    scale = best_scale(p, total, gain) * (1.0 + (bounce if fastest > REST_SPEED else 0.0))
    apply_impulse(state, p, total, scale)
    for index in range(POINTS):
        pushes[index] *= scale


@inner
def rub(state: Any, p: Any, rot: Rotation, normal: float, pushes: Any) -> None:
    """Friction impulses of the points that pushed, within the Coulomb cone, against their slip."""
    total = np.zeros(6)
    gain = 0.0
    for index in range(POINTS):
        if pushes[index] <= 0.0:
            continue
        point = hull_point(p, rot, index, normal)
        vx, vy, _ = point_velocity(state, rot, point)
        slip = math.hypot(vx, vy)
        if slip < 1e-9:
            continue
        nx, ny = -vx / slip, -vy / slip
        arm = lever(rot, point, nx, ny, 0.0)
        grip = min(slip / mobility(p, arm), p.friction * pushes[index])
        total[0] += grip * nx
        total[1] += grip * ny
        total[3] += grip * arm[0]
        total[4] += grip * arm[1]
        total[5] += grip * arm[2]
        gain += grip * slip
    apply_impulse(state, p, total, min(1.0, best_scale(p, total, gain)))


@kernel
def touches(state: Any, p: Any, rot: Rotation, normal: float) -> bool:
    """Whether any point of hull or propellers lies beyond the plane: the extreme of box and discs."""
    gx, gy, gz = -normal * rot[6], -normal * rot[7], -normal * rot[8]
    box = abs(gx) * p.body_half_x + abs(gy) * p.body_half_y + max(gz * p.body_top_z, gz * p.body_bottom_z)
    discs = abs(gx) * p.arm_x + abs(gy) * p.arm_y + gz * p.propeller_height_z
    discs += p.rim_radius * math.sqrt(gx * gx + gy * gy)
    z = state.position[2]
    gap = p.ceiling_z - z if normal < 0.0 else z
    return max(box, discs) + gx * p.geometric_centre[0] + gy * p.geometric_centre[1] >= gap


@inner
def collide(state: Any, p: Any, rot: Rotation, normal: float) -> None:
    """Impulses of one plane (ceiling: normal -1, floor: +1) on all touching points of hull and propellers."""
    pushes = np.zeros(POINTS)
    for index in range(PASSES):
        push_out(state, p, rot, normal, pushes, p.restitution if index == 0 else 0.0)
        rub(state, p, rot, normal, pushes)
