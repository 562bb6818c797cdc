"""One step of the simulated world: drift, kick, drift; in small steps while anything may touch."""

import math
from typing import Any

from onboard.arrays import Vector
from onboard.mixer import Thrusts
from sim_backend.physics.battery import draw, motor_targets
from sim_backend.physics.collision import Rotation, collide, touches
from sim_backend.physics.forces import add, free_flight_wrench
from sim_backend.physics.jit import kernel
from sim_backend.physics.legs import (
    ATTACHED,
    CLEARANCE,
    FREE,
    PRESSING_CEILING,
    PRESSING_FLOOR,
    RELEASED,
    foot_force,
    hold_foot,
)
from sim_backend.physics.motors import Wrench, commanded, decay, lag_all
from sim_backend.physics.rigid_body import rotation_matrix, turn, turn_rate


@kernel
def to_body(rot: Rotation, x: float, y: float, z: float) -> Vector:
    """World to body components."""
    return (
        rot[0] * x + rot[3] * y + rot[6] * z,
        rot[1] * x + rot[4] * y + rot[7] * z,
        rot[2] * x + rot[5] * y + rot[8] * z,
    )


@kernel
def to_world(rot: Rotation, x: float, y: float, z: float) -> Vector:
    """Body to world components."""
    return (
        rot[0] * x + rot[1] * y + rot[2] * z,
        rot[3] * x + rot[4] * y + rot[5] * z,
        rot[6] * x + rot[7] * y + rot[8] * z,
    )


@kernel
def drift(state: Any, dt: float) -> None:
    """Move position and attitude with the present velocities for `dt` (s)."""
    position, velocity, q, w = state.position, state.velocity, state.quaternion, state.omega
    position[0] += dt * velocity[0]
    position[1] += dt * velocity[1]
    position[2] += dt * velocity[2]
    q[0], q[1], q[2], q[3] = turn((q[0], q[1], q[2], q[3]), w[0], w[1], w[2], dt)


@kernel
def kick(state: Any, p: Any, rot: Rotation, wrench: Wrench, dt: float) -> None:
    """Change the velocities by a constant body-frame wrench and gravity for `dt` (s)."""
    fx, fy, fz = to_world(rot, wrench[0], wrench[1], wrench[2])
    per_mass = dt / p.mass
    velocity, w, inertia = state.velocity, state.omega, p.inertia
    velocity[0] += per_mass * fx
    velocity[1] += per_mass * fy
    velocity[2] += per_mass * fz - dt * p.gravity
    ix, iy, iz = inertia[0], inertia[1], inertia[2]
    w[0], w[1], w[2] = turn_rate(
        w[0], w[1], w[2], wrench[3], wrench[4], wrench[5], ix, iy, iz, 1.0 / ix, 1.0 / iy, 1.0 / iz, dt
    )


@kernel
def attitude(state: Any) -> Rotation:
    """Rotation matrix of the state, row by row."""
    q = state.quaternion
    return rotation_matrix(q[0], q[1], q[2], q[3])


@kernel
def free_substep(state: Any, p: Any, targets: Thrusts, dt: float, up: float, down: float) -> None:
    """`dt` (s) of free flight; `up` and `down` are the motor decays of half the time."""
    drift(state, 0.5 * dt)
    lag_all(state, p, targets, up, down, 0.5 * dt)
    rot = attitude(state)
    velocity = state.velocity
    vx, vy, vz = to_body(rot, velocity[0], velocity[1], velocity[2])
    wrench = free_flight_wrench(state, p, rot, vx, vy, vz)
    kick(state, p, rot, wrench, dt)
    lag_all(state, p, targets, up, down, 0.5 * dt)
    drift(state, 0.5 * dt)
    state.specific_force[0] = wrench[0] / p.mass
    state.specific_force[1] = wrench[1] / p.mass
    state.specific_force[2] = wrench[2] / p.mass
    state.time += dt


@kernel
def leg_wrench(state: Any, p: Any, rot: Rotation, vx: float, vy: float, vz: float) -> Wrench:
    """Wrench of all touching feet on the body, body frame; feet attach, slide and come off on the way."""
    wrench = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    position, w = state.position, state.omega
    for leg in range(4):
        mode = state.foot_mode[leg]
        if mode in (FREE, RELEASED):
            continue
        anchor = state.foot_anchor[leg]
        px, py, pz = to_body(rot, anchor[0] - position[0], anchor[1] - position[1], anchor[2] - position[2])
        fx, fy, fz = foot_force(p, leg, px, py, pz, vx, vy, vz, w[0], w[1], w[2])
        fx, fy, fz = to_world(rot, fx, fy, fz)
        held = hold_foot(p, state, leg, fx, fy, fz)
        fx, fy, fz = to_body(rot, held[0], held[1], held[2])
        wrench = add(wrench, (fx, fy, fz, py * fz - pz * fy, pz * fx - px * fz, px * fy - py * fx))
    return wrench


@kernel
def touch_feet(state: Any, p: Any) -> None:
    """Let free feet that reached the ceiling or the floor take hold where they are."""
    rot = attitude(state)
    position = state.position
    for leg in range(4):
        mode = state.foot_mode[leg]
        if mode not in (FREE, RELEASED):
            continue
        bx = p.hip[leg, 0] + p.leg_length * p.leg_direction[leg, 0]
        by = p.hip[leg, 1] + p.leg_length * p.leg_direction[leg, 1]
        bz = p.hip[leg, 2] + p.leg_length * p.leg_direction[leg, 2]
        fx, fy, fz = to_world(rot, bx, by, bz)
        x, y, z = position[0] + fx, position[1] + fy, position[2] + fz
        gap = p.ceiling_z - p.foot_radius - z
        if mode == RELEASED:
            if gap > CLEARANCE:
                state.foot_mode[leg] = FREE
            continue
        if gap <= 0.0:
            state.foot_mode[leg] = PRESSING_CEILING
            if p.minimum_preload <= 0.0:
                state.foot_mode[leg] = ATTACHED
                state.foot_attached[leg] = 1
            record_impact(state)
        elif z <= p.foot_radius:
            state.foot_mode[leg] = PRESSING_FLOOR
        else:
            continue
        state.foot_anchor[leg, 0], state.foot_anchor[leg, 1], state.foot_anchor[leg, 2] = x, y, z


@kernel
def record_impact(state: Any) -> None:
    """Keep time, attitude and velocities of the first contact of anything with the ceiling."""
    if state.ceiling_contact:
        return
    state.ceiling_contact = 1
    state.impact_time = state.time
    for i in range(3):
        state.impact_velocity[i] = state.velocity[i]
        state.impact_omega[i] = state.omega[i]
    for i in range(4):
        state.impact_quaternion[i] = state.quaternion[i]


@kernel
def collide_all(state: Any, p: Any, rot: Rotation) -> None:
    """Impulses of ceiling and floor on hull and propellers."""
    z = state.position[2]
    if z + p.reach >= p.ceiling_z and touches(state, p, rot, -1.0):
        record_impact(state)
        if not state.body_contact:
            state.body_contact = 1
            state.body_contact_time = state.time
        collide(state, p, rot, -1.0)
    if z - p.reach <= 0.0 and touches(state, p, rot, 1.0):
        collide(state, p, rot, 1.0)


@kernel
def contact_substep(state: Any, p: Any, targets: Thrusts, dt: float, up: float, down: float) -> None:
    """`dt` (s) with everything that may touch; leaves the mean specific force of the substep in the state."""
    drift(state, 0.5 * dt)
    lag_all(state, p, targets, up, down, 0.5 * dt)
    rot = attitude(state)
    velocity = state.velocity
    ux, uy, uz = velocity[0], velocity[1], velocity[2]
    vx, vy, vz = to_body(rot, ux, uy, uz)
    wrench = add(free_flight_wrench(state, p, rot, vx, vy, vz), leg_wrench(state, p, rot, vx, vy, vz))
    kick(state, p, rot, wrench, dt)
    collide_all(state, p, rot)
    sx, sy, sz = to_body(
        rot, (velocity[0] - ux) / dt, (velocity[1] - uy) / dt, (velocity[2] - uz) / dt + p.gravity
    )
    state.specific_force[0], state.specific_force[1], state.specific_force[2] = sx, sy, sz
    lag_all(state, p, targets, up, down, 0.5 * dt)
    drift(state, 0.5 * dt)
    state.time += dt
    if p.has_legs:
        touch_feet(state, p)


@kernel
def near_surface(state: Any, p: Any, dt: float) -> bool:
    """Whether anything of the vehicle touches, or may touch, ceiling or floor within `dt` (s)."""
    mode = state.foot_mode
    if mode[0] + mode[1] + mode[2] + mode[3] != FREE:
        return True
    margin = p.reach + dt * (abs(state.velocity[2]) + 1.0)
    z = state.position[2]
    return z + margin >= p.ceiling_z or z - margin <= 0.0


@kernel
def advance(
    state: Any, p: Any, targets: Thrusts, dt: float, up: float, down: float, fine_up: float, fine_down: float
) -> None:
    """One step of `dt` (s) towards the thrust targets (N).

    `up`, `down`: motor decays of dt / 2; `fine_up`, `fine_down`: of half a substep (see :func:`half_decays`).
    """
    targets = commanded(state, p, targets)
    if not near_surface(state, p, dt):
        free_substep(state, p, targets, dt, up, down)
        return
    n = p.substeps
    sx, sy, sz = 0.0, 0.0, 0.0
    for _ in range(n):
        contact_substep(state, p, targets, dt / n, fine_up, fine_down)
        sx += state.specific_force[0]
        sy += state.specific_force[1]
        sz += state.specific_force[2]
    state.specific_force[0], state.specific_force[1], state.specific_force[2] = sx / n, sy / n, sz / n


@kernel
def half_decays(p: Any, dt: float) -> tuple[float, float, float, float]:
    """Motor decays (up, down) of half a step of `dt` (s) and of half a substep."""
    up, down = decay(p, 0.5 * dt)
    fine_up, fine_down = decay(p, 0.5 * dt / p.substeps)
    return up, down, fine_up, fine_down


@kernel
def step_thrust(state: Any, p: Any, targets: Thrusts, dt: float) -> None:
    """One step of `dt` (s) towards four thrusts (N): for a battery compensation that is perfect."""
    up, down, fine_up, fine_down = half_decays(p, dt)
    advance(state, p, targets, dt, up, down, fine_up, fine_down)


@kernel
def step(state: Any, parameters: Any, duty: Any, dt: float) -> None:
    """One step of the world with its battery, contact included; changes the record `state` in place.

    Args:
        state: record of :data:`sim_backend.physics.state.STATE`.
        parameters: record of :data:`sim_backend.physics.parameters.PARAMETERS`.
        duty: float64[4], part of the battery voltage at each motor, 0..1 (clipped).
        dt: s, 0.001 in all of perchhw.
    """
    targets = motor_targets(state, parameters, duty)
    step_thrust(state, parameters, targets, dt)
    draw(state, parameters, dt)


@kernel
def is_finite(state: Any) -> bool:
    """Whether the numbers of the state are still numbers."""
    total = state.time
    for i in range(3):
        total += state.position[i] + state.velocity[i] + state.omega[i]
    for i in range(4):
        total += state.quaternion[i] + state.thrust[i]
    return math.isfinite(total)
