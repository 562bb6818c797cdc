"""One step of the simulated world: drift, kick, drift; cut where a foot meets the ceiling."""

import math
from typing import Any

import numpy as np

from onboard.arrays import Vector
from onboard.mixer import Thrusts
from sim_backend.physics.battery import draw, motor_targets
from sim_backend.physics.collision import collide, touches
from sim_backend.physics.effects.pad_damping import pad_wrench
from sim_backend.physics.feet import (
    ATTACHED,
    FREE,
    any_can_touch,
    can_touch,
    hold_foot,
    time_to_touch,
    touch_feet,
)
from sim_backend.physics.forces import add, free_flight_wrench
from sim_backend.physics.frames import Rotation, Wrench, cross, to_body, to_world
from sim_backend.physics.jit import alone, inner, kernel, outlined
from sim_backend.physics.legs import hinge_force
from sim_backend.physics.motors import commanded, decay, lag_to_end, lag_to_middle
from sim_backend.physics.rigid_body import (
    acceleration_beside,
    rotation_matrix,
    turn,
    turn_rate,
    unit,
)
from sim_backend.physics.rods import LOOSE, Inverse, Rod, coupling, rod_forces

HeldLeg = tuple[Rod, Vector, Vector]
"""(rod, hinge force in N, foot in m) of one leg in the middle of a step, body frame."""

MOST_PARTS = 9
"""Parts of a step: each of the four feet may cut it twice, where its path bends away at the first cut."""

LEGS: Any = tuple(np.int64(leg) for leg in range(4))
"""Indices of the legs; not plain integers, so that one compiled function serves all (:mod:`onboard.jit`)."""

NOTHING: Vector = (0.0, 0.0, 0.0)


@inner
def drift_to_middle(state: Any, dt: float) -> None:
    """Move position and attitude with the present velocities for `dt` (s), half a step."""
    position, velocity, q, w = state.position, state.velocity, state.quaternion, state.omega
    position[0] += dt * velocity[0]
    position[1] += dt * velocity[1]
    position[2] += dt * velocity[2]
    q[0], q[1], q[2], q[3] = turn((q[0], q[1], q[2], q[3]), w[0], w[1], w[2], dt)


@inner
def drift_to_end(state: Any, dt: float) -> None:
    """The other half, and the quaternion back to unit length."""
    drift_to_middle(state, dt)
    q = state.quaternion
    q[0], q[1], q[2], q[3] = unit((q[0], q[1], q[2], q[3]))


@inner
def inverse_inertia(p: Any) -> Inverse:
    """1/mass (1/kg) and one over the three moments of inertia (1/(kg m2))."""
    return 1.0 / p.mass, 1.0 / p.inertia[0], 1.0 / p.inertia[1], 1.0 / p.inertia[2]


@inner
def kick(state: Any, p: Any, rot: Rotation, inverse: Inverse, wrench: Wrench, dt: float) -> None:
    """Change the velocities by a constant body-frame wrench and gravity for `dt` (s)."""
    fx, fy, fz = to_world(rot, wrench[0], wrench[1], wrench[2])
    per_mass = dt * inverse[0]
    velocity, w, inertia = state.velocity, state.omega, p.inertia
    velocity[0] += per_mass * fx
    velocity[1] += per_mass * fy
    velocity[2] += per_mass * fz - dt * p.gravity
    w[0], w[1], w[2] = turn_rate(
        w[0], w[1], w[2], wrench[3], wrench[4], wrench[5],
        inertia[0], inertia[1], inertia[2], inverse[1], inverse[2], inverse[3], dt,
    )  # fmt: skip


@kernel
def attitude(state: Any) -> Rotation:
    """Rotation matrix of the state, row by row."""
    q = state.quaternion
    return rotation_matrix(q[0], q[1], q[2], q[3])


@inner
def in_free_flight(state: Any, p: Any) -> tuple[Rotation, Vector, Wrench]:
    """Attitude, velocity (m/s, body frame), and the wrench of a free flight at both."""
    rot, velocity = attitude(state), state.velocity
    v = to_body(rot, velocity[0], velocity[1], velocity[2])
    return rot, v, free_flight_wrench(state, p, rot, v[0], v[1], v[2])


@inner
def feel(state: Any, p: Any, force: Vector, before: Vector, dt: float) -> None:
    """Put the mean specific force (m/s2, body) of a substep into the state, as felt in the drone's middle.

    Args:
        state, p: the vehicle.
        force: specific force at the centre of mass, m/s2, body.
        before: body rate (rad/s) at the beginning of the substep.
        dt: s, its length.
    """
    x, y, z = force
    if p.sensors_on:  # the board is where the drone's middle is, beside the centre of mass
        w, c = state.omega, p.geometric_centre
        turn_up = ((w[0] - before[0]) / dt, (w[1] - before[1]) / dt, (w[2] - before[2]) / dt)
        wx, wy, wz = 0.5 * (w[0] + before[0]), 0.5 * (w[1] + before[1]), 0.5 * (w[2] + before[2])
        beside = acceleration_beside((c[0], c[1], c[2]), wx, wy, wz, turn_up)
        x, y, z = x + beside[0], y + beside[1], z + beside[2]
    state.specific_force[0], state.specific_force[1], state.specific_force[2] = x, y, z


@inner
def free_substep(state: Any, p: Any, targets: Thrusts, dt: float, up: float, down: float) -> None:
    """`dt` (s) of free flight; `up` and `down` are the motor decays of half the time."""
    drift_to_middle(state, 0.5 * dt)
    lag_to_middle(state, p, targets, up, down, 0.5 * dt)
    rot, _, wrench = in_free_flight(state, p)
    inverse, w = inverse_inertia(p), state.omega
    before = w[0], w[1], w[2]
    kick(state, p, rot, inverse, wrench, dt)
    lag_to_end(state, p, targets, up, down)
    drift_to_end(state, 0.5 * dt)
    force = wrench[0] * inverse[0], wrench[1] * inverse[0], wrench[2] * inverse[0]
    feel(state, p, force, before, dt)
    state.time += dt


@inner
def held_leg(state: Any, p: Any, rot: Rotation, leg: int, v: Vector, w: Vector) -> HeldLeg:
    """Rod, hinge force and foot of one leg in the middle of a step; all zero while its foot is free.

    Args:
        state, p: the vehicle.
        rot: its attitude.
        leg: index 0..3.
        v, w: velocity (m/s) and rate (rad/s), body frame.
    """
    if can_touch(state.foot_mode[leg]):
        return LOOSE, NOTHING, NOTHING
    anchor, position = state.foot_anchor[leg], state.position
    foot = to_body(rot, anchor[0] - position[0], anchor[1] - position[1], anchor[2] - position[2])
    rx, ry, rz = foot[0] - p.hip[leg, 0], foot[1] - p.hip[leg, 1], foot[2] - p.hip[leg, 2]
    length = math.sqrt(rx * rx + ry * ry + rz * rz)
    inverse = 1.0 / length
    u = (rx * inverse, ry * inverse, rz * inverse)
    # The anchor rests in the world: seen from the body it moves with -(v + w x p).
    turn = cross(w, foot)
    d = (-v[0] - turn[0], -v[1] - turn[1], -v[2] - turn[2])
    arm = cross(foot, u)
    rod = (u[0], u[1], u[2], arm[0], arm[1], arm[2], length - p.leg_length)
    return rod, hinge_force(p, leg, u, inverse, d), foot


@inner
def wrench_at(foot: Vector, force: Vector) -> Wrench:
    """Wrench of a force (N) at a point (m), body frame."""
    moment = cross(foot, force)
    return force[0], force[1], force[2], moment[0], moment[1], moment[2]


@inner
def foot_reaction(
    state: Any, p: Any, rot: Rotation, leg: int, held: HeldLeg, pull: float, inverse: Inverse, dt: float
) -> Wrench:
    """What a surface adds to the hinge's force on a foot: the pull of its rod, or what the foot can hold."""
    rod, hinge, foot = held
    x, y, z = hinge[0] + pull * rod[0], hinge[1] + pull * rod[1], hinge[2] + pull * rod[2]
    mode = state.foot_mode[leg]
    down = rot[6] * x + rot[7] * y + rot[8] * z
    if can_touch(mode) or (mode == ATTACHED and down <= p.adhesion_strength):
        return pull * rod[0], pull * rod[1], pull * rod[2], pull * rod[3], pull * rod[4], pull * rod[5]
    give = p.axial_damping + 0.5 * dt * p.axial_stiffness
    along = give / (dt + dt * dt * give * coupling(rod, rod, inverse))
    # Of a hinge of two axes the stiffer one: a foot that slid too far would gain what nobody paid for.
    stiffer, slower = 1.0 + max(p.sideways_stiffness, 0.0), 1.0 + max(p.sideways_damping, 0.0)
    across = (slower * p.hinge_damping / dt + 0.5 * stiffer * p.hinge_stiffness) / p.leg_length**2
    force, u = to_world(rot, x, y, z), to_world(rot, rod[0], rod[1], rod[2])
    wx, wy, wz = hold_foot(p, state, leg, force, u, across, along, dt)
    x, y, z = to_body(rot, wx, wy, wz)
    return wrench_at(foot, (x - hinge[0], y - hinge[1], z - hinge[2]))


@inner
def push(state: Any, rot: Rotation, inverse: Inverse, wrench: Wrench, dt: float) -> None:
    """Change the velocities by the impulse of a body-frame wrench over `dt` (s), without gravity."""
    fx, fy, fz = to_world(rot, wrench[0], wrench[1], wrench[2])
    per_mass = dt * inverse[0]
    state.velocity[0] += per_mass * fx
    state.velocity[1] += per_mass * fy
    state.velocity[2] += per_mass * fz
    state.omega[0] += dt * inverse[1] * wrench[3]
    state.omega[1] += dt * inverse[2] * wrench[4]
    state.omega[2] += dt * inverse[3] * wrench[5]


@inner
def kick_with_legs(
    state: Any, p: Any, rot: Rotation, inverse: Inverse, wrench: Wrench, v: Vector, dt: float
) -> None:
    """As :func:`kick`, with the forces of all held feet; they take hold, slide and come off on the way."""
    w = (state.omega[0], state.omega[1], state.omega[2])
    leg0, leg1 = held_leg(state, p, rot, LEGS[0], v, w), held_leg(state, p, rot, LEGS[1], v, w)
    leg2, leg3 = held_leg(state, p, rot, LEGS[2], v, w), held_leg(state, p, rot, LEGS[3], v, w)
    hinges = add(
        add(wrench_at(leg0[2], leg0[1]), wrench_at(leg1[2], leg1[1])),
        add(wrench_at(leg2[2], leg2[1]), wrench_at(leg3[2], leg3[1])),
    )
    kick(state, p, rot, inverse, add(wrench, hinges), dt)
    velocity = state.velocity
    v = to_body(rot, velocity[0], velocity[1], velocity[2])
    w = (state.omega[0], state.omega[1], state.omega[2])
    pulls = rod_forces(p, inverse, leg0[0], leg1[0], leg2[0], leg3[0], v, w, dt)
    reactions = add(
        add(
            foot_reaction(state, p, rot, LEGS[0], leg0, pulls[0], inverse, dt),
            foot_reaction(state, p, rot, LEGS[1], leg1, pulls[1], inverse, dt),
        ),
        add(
            foot_reaction(state, p, rot, LEGS[2], leg2, pulls[2], inverse, dt),
            foot_reaction(state, p, rot, LEGS[3], leg3, pulls[3], inverse, dt),
        ),
    )
    push(state, rot, inverse, reactions, dt)
    if p.pad_damping > 0.0:
        push(state, rot, inverse, pad_wrench(state, p, rot, leg0[0], leg1[0], leg2[0], leg3[0]), dt)


@inner
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


@inner
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


@inner
def contact_substep(state: Any, p: Any, targets: Thrusts, dt: float, up: float, down: float) -> None:
    """`dt` (s) with everything that may touch; leaves the mean specific force of the substep in the state."""
    drift_to_middle(state, 0.5 * dt)
    lag_to_middle(state, p, targets, up, down, 0.5 * dt)
    rot, v, wrench = in_free_flight(state, p)
    velocity = state.velocity
    ux, uy, uz = velocity[0], velocity[1], velocity[2]
    inverse, w = inverse_inertia(p), state.omega
    before = w[0], w[1], w[2]
    if any_foot_holds(state):
        kick_with_legs(state, p, rot, inverse, wrench, v, dt)
    else:
        kick(state, p, rot, inverse, wrench, dt)
    collide_all(state, p, rot)
    rate = 1.0 / dt
    force = to_body(
        rot, (velocity[0] - ux) * rate, (velocity[1] - uy) * rate, (velocity[2] - uz) * rate + p.gravity
    )
    feel(state, p, force, before, dt)
    lag_to_end(state, p, targets, up, down)
    drift_to_end(state, 0.5 * dt)
    state.time += dt


@alone
def contact_step(state: Any, p: Any, targets: Thrusts, dt: float, up: float, down: float) -> None:
    """`dt` (s) near a surface, cut where a foot meets the ceiling, so that it takes hold just there.

    `up`, `down`: motor decays of dt / 2. The last part takes all that is left of the step, so that no time is
    lost; the specific force is the mean of the parts.
    """
    left = dt
    sx, sy, sz = 0.0, 0.0, 0.0
    for index in range(MOST_PARTS):
        may_touch = p.has_legs and any_can_touch(state)
        part = left
        if may_touch and index < MOST_PARTS - 1:
            part = time_to_touch(state, p, attitude(state), left)
        if part < dt:
            up, down = decay(p, 0.5 * part)
        contact_substep(state, p, targets, part, up, down)
        if may_touch and touch_feet(state, p, attitude(state)):
            record_impact(state)
        share = part / dt
        sx += share * state.specific_force[0]
        sy += share * state.specific_force[1]
        sz += share * state.specific_force[2]
        left -= part
        if left <= 0.0:
            break
    state.specific_force[0], state.specific_force[1], state.specific_force[2] = sx, sy, sz


@inner
def any_foot_holds(state: Any) -> bool:
    """Whether any foot touches ceiling or floor."""
    mode = state.foot_mode
    return not (can_touch(mode[0]) and can_touch(mode[1]) and can_touch(mode[2]) and can_touch(mode[3]))


@inner
def near_surface(state: Any, p: Any, dt: float) -> bool:
    """Whether anything of the vehicle touches, or may touch, ceiling or floor within `dt` (s)."""
    mode, refused, impulse = state.foot_mode, state.foot_refused, state.foot_impulse
    if mode[0] + mode[1] + mode[2] + mode[3] != FREE:
        return True
    if refused[0] + refused[1] + refused[2] + refused[3] != 0:
        return True  # until the foot is clear
    if impulse[0] + impulse[1] + impulse[2] + impulse[3] > 0.0:
        return True  # likewise
    margin = p.reach + dt * (abs(state.velocity[2]) + 1.0)
    z = state.position[2]
    return z + margin >= p.ceiling_z or z - margin <= 0.0


@kernel
def advance(state: Any, p: Any, targets: Thrusts, dt: float, up: float, down: float) -> None:
    """One step of `dt` (s) towards the thrust targets (N).

    `up`, `down`: motor decays of dt / 2 (:func:`sim_backend.physics.motors.decay`).
    """
    targets = commanded(state, p, targets)
    if near_surface(state, p, dt):
        contact_step(state, p, targets, dt, up, down)
    else:
        free_substep(state, p, targets, dt, up, down)


@kernel
def step_thrust(state: Any, p: Any, targets: Thrusts, dt: float) -> None:
    """One step of `dt` (s) towards four thrusts (N): for a battery compensation that is perfect."""
    up, down = decay(p, 0.5 * dt)
    advance(state, p, targets, dt, up, down)


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
    up, down = decay(parameters, 0.5 * dt)
    advance(state, parameters, targets, dt, up, down)
    draw(state, parameters, dt)


@outlined
def step_first(states: Any, parameters: Any, duty: Any, dt: float) -> None:
    """:func:`step` of the first record of each array, for callers in Python.

    Handing over a record takes numba longer than a step of the physics takes, an array nearly nothing.
    """
    step(states[0], parameters[0], duty, dt)


@kernel
def is_finite(state: Any) -> bool:
    """Whether the numbers of the state are still numbers."""
    total = state.time
    for i in range(3):
        total += state.position[i] + state.velocity[i] + state.omega[i]
    for i in range(4):
        total += state.quaternion[i] + state.thrust[i]
    return math.isfinite(total)
