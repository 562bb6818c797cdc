"""Forces of the ceiling on the vehicle in the world frame, by penalties, for steps of 50 us.

Written from docs/physics.md ("Legs", "Hull and propellers"): a rod with a torsional hinge at the hip, stiff
along its axis; feet that hold, need a push or a speed, slide or tear off; a hull that bounces. Everything is
explicit and in world coordinates.
"""

import numpy as np

from tests.truth.landings.jit import jitted

FREE, PRESSED, HELD, TORN, REFUSED = 0, 1, 2, 3, 4
CLEAR = 5e-4  # m, after which a torn foot may touch again
HULL_STIFFNESS = 3e4  # N/m

# Order of the numbers of a vehicle in the compiled code.
(
    MASS, IXX, IYY, IZZ, LEG, K, C, STOP, ROD_K, ROD_C, ADHESION, PRELOAD, RESTITUTION, HULL_MU, FOOT_MU,
    FOOT_R, CEILING, ROTOR_R, CAPTURE, SIDE_K, SIDE_C,
) = range(21)  # fmt: skip


@jitted
def _cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@jitted
def leg_pull(n, hip, hip_v, spin, anchor, rest, up):
    """Force of the surface on a held foot, all in the world: hip and its velocity, body rate, anchor.

    `rest` is the rod at rest and `up` the body's axis: the leg's plane, which the second axis lies in.
    """
    r = anchor - hip
    size = np.sqrt(r @ r)
    u = r / size
    r_dot = -hip_v
    size_dot = u @ r_dot
    u_dot = (r_dot - size_dot * u) / size - _cross(spin, u)  # as the body sees it
    axis = _cross(rest, u)
    sine = np.sqrt(axis @ axis)
    moment = -n[C] * _cross(u, u_dot)
    if sine > 1e-10:
        bend = np.arctan2(sine, rest @ u)
        torque = n[K] * bend + 10.0 * n[K] * max(0.0, bend - n[STOP])
        moment = moment - torque * axis / sine
    if n[SIDE_K] != 1.0 or n[SIDE_C] != 1.0:
        normal = _cross(up, rest)
        normal = normal / np.sqrt(normal @ normal)
        lean = np.arcsin(u @ normal)
        faster = (u_dot @ normal) / np.cos(lean)
        more = (n[SIDE_K] - 1.0) * n[K] * lean + (n[SIDE_C] - 1.0) * n[C] * faster
        moment = moment - more * _cross(u, normal) / np.cos(lean)
    across = _cross(r, moment) / size**2
    axial = n[ROD_K] * (size - n[LEG]) + n[ROD_C] * size_dot
    return across + axial * u


@jitted
def slide(n, force, anchor):
    """Move an anchor that friction cannot hold, and cut the force to the cone."""
    push = -force[2]
    side = np.hypot(force[0], force[1])
    most = n[FOOT_MU] * push
    if side <= most:
        return
    give = (side - most) / (4.0 * n[K] / n[LEG] ** 2 + 0.2 * n[ROD_K])
    for i in range(2):
        anchor[i] -= give * force[i] / side
        force[i] *= most / side


@jitted
def add(force, arm, total):
    """A force and its moment about the origin of `arm` to `total` (6,)."""
    moment = _cross(arm, force)
    for i in range(3):
        total[i] += force[i]
        total[3 + i] += moment[i]


@jitted
def feet(n, x, v, R, spin, hips, rests, mode, anchors, total):
    """Add the force and the world moment about the centre of mass of all feet to `total` (6,)."""
    for k in range(4):
        arm = R @ hips[k]
        hip = x + arm
        rest = R @ rests[k]
        tip = hip + n[LEG] * rest
        gap = n[CEILING] - n[FOOT_R] - tip[2]
        if mode[k] == TORN and gap > CLEAR:
            mode[k] = FREE
        if mode[k] == FREE and gap <= 0.0:
            for i in range(3):  # here and below: arrays assigned to slices take seconds to compile
                anchors[k, i] = tip[i]
            climb = v[2] + _cross(spin, tip - x)[2]
            if climb < n[CAPTURE]:
                mode[k] = REFUSED
            else:
                mode[k] = HELD if n[PRELOAD] <= 0.0 else PRESSED
        if mode[k] == FREE or mode[k] == TORN:
            continue
        force = leg_pull(n, hip, v + _cross(spin, arm), spin, anchors[k], rest, np.ascontiguousarray(R[:, 2]))
        if mode[k] == REFUSED:
            if force[2] >= 0.0:
                mode[k] = TORN  # until it is clear of the ceiling; the same push cannot catch later
                continue
            slide(n, force, anchors[k])
        if mode[k] == PRESSED:
            if -force[2] >= n[PRELOAD]:
                mode[k] = HELD
            elif force[2] >= 0.0:
                mode[k] = FREE
                continue
            else:
                slide(n, force, anchors[k])
        if mode[k] == HELD and force[2] > n[ADHESION]:
            mode[k] = TORN
            continue
        add(force, anchors[k] - x, total)


@jitted
def hull(n, x, v, R, spin, points, discs, total):
    """Add what the ceiling does to corners and propellers to `total` (6,); whether anything touched."""
    touched = False
    up = R[2]  # world z seen from the body
    flat = np.hypot(up[0], up[1])
    for k in range(points.shape[0] + discs.shape[0]):
        if k < points.shape[0]:
            body = points[k].copy()
        else:
            body = discs[k - points.shape[0]].copy()
            if flat > 1e-9:
                body[0] += n[ROTOR_R] * up[0] / flat
                body[1] += n[ROTOR_R] * up[1] / flat
        arm = R @ body
        deep = x[2] + arm[2] - n[CEILING]
        if deep <= 0.0:
            continue
        touched = True
        speed = v + _cross(spin, arm)
        lever = R.T @ _cross(arm, np.array([0.0, 0.0, 1.0]))
        inverse = 1.0 / n[MASS]
        for i in range(3):
            inverse += lever[i] ** 2 / n[IXX + i]
        log = np.log(n[RESTITUTION])
        ratio = -log / np.sqrt(np.pi**2 + log**2)
        damping = 2.0 * ratio * np.sqrt(HULL_STIFFNESS / inverse)
        push = HULL_STIFFNESS * deep + damping * speed[2]
        if push <= 0.0:
            continue
        slip = np.hypot(speed[0], speed[1])
        grip = n[HULL_MU] * push / max(slip, 0.02)
        force = np.array([-grip * speed[0], -grip * speed[1], -push])
        add(force, arm, total)
    return touched
