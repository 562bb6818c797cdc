"""What a foot does: when it touches, when it takes hold, slides, and comes off."""

import math
from typing import Any

import numpy as np

from onboard.arrays import Vector
from sim_backend.physics.frames import Rotation, cross, to_world
from sim_backend.physics.jit import inner
from sim_backend.physics.sliding import slide
from sim_backend.physics.state import FootMode

FREE = int(FootMode.FREE)
PRESSING_CEILING = int(FootMode.PRESSING_CEILING)
PRESSING_FLOOR = int(FootMode.PRESSING_FLOOR)
ATTACHED = int(FootMode.ATTACHED)
RELEASED = int(FootMode.RELEASED)

CLEARANCE = 5e-4
"""m: a foot that was torn off may touch again, and one that did not stick may stick again, once its rest
position is this far below the ceiling."""

LAWS: Any = tuple(np.int64(law) for law in range(4))
"""What a pad may ask of a foot, each with a limit of its own: indices of ``limits_met`` of the state."""

SPEED, PUSH, IMPULSE, UPRIGHT = LAWS

TOGETHER = 1e-7
"""m: a foot this close to the ceiling touches with the one that is there: left and right stay alike."""


@inner
def rest_foot(p: Any, leg: int) -> Vector:
    """Where the foot of an unbent leg is, body frame (m)."""
    return (
        p.hip[leg, 0] + p.leg_length * p.leg_direction[leg, 0],
        p.hip[leg, 1] + p.leg_length * p.leg_direction[leg, 1],
        p.hip[leg, 2] + p.leg_length * p.leg_direction[leg, 2],
    )


@inner
def can_touch(mode: int) -> bool:
    """Whether a foot in this mode may still come to touch."""
    return mode in (FREE, RELEASED)


@inner
def any_can_touch(state: Any) -> bool:
    """Whether any foot is off the surfaces."""
    mode = state.foot_mode
    return can_touch(mode[0]) or can_touch(mode[1]) or can_touch(mode[2]) or can_touch(mode[3])


@inner
def ceiling_gap(state: Any, p: Any, rot: Rotation, foot: Vector) -> float:
    """Distance (m) of a foot's surface to the ceiling, negative beyond it."""
    return p.ceiling_z - p.foot_radius - state.position[2] - to_world(rot, foot[0], foot[1], foot[2])[2]


@inner
def normal_speed(state: Any, rot: Rotation, foot: Vector) -> float:
    """Speed (m/s) at which a body point moves towards the ceiling."""
    turn = cross((state.omega[0], state.omega[1], state.omega[2]), foot)
    return float(state.velocity[2] + to_world(rot, turn[0], turn[1], turn[2])[2])


@inner
def uprightness(widest: float) -> float:
    """Least cosine of the angle between rod and normal, from the widest angle (rad, cut to 0..pi)."""
    return math.cos(min(max(widest, 0.0), math.pi))


@inner
def pad_limit(p: Any, law: int) -> float:
    """What a pad asks of a foot by one of its laws, where landings do not differ: m/s, N, N s, cosine."""
    if law == SPEED:
        return float(p.capture_speed)
    if law == PUSH:
        return float(p.minimum_preload)
    return float(p.pad_impulse) if law == IMPULSE else uprightness(p.pad_angle)


@inner
def meets(state: Any, law: int, value: float, limit: float) -> bool:
    """Whether a foot has what its pad asks for by a law.

    A pad with a higher limit would have done the same as long as the limit is within ``limits_met``: then the
    whole landing is the same.
    """
    if value < limit:
        return False
    state.limits_met[law] = min(state.limits_met[law], value)
    return True


@inner
def sticks(state: Any, p: Any, rot: Rotation, leg: int, foot: Vector) -> bool:
    """Whether a foot that touches the ceiling now can adhere: fast enough for its pad (``pad_capture``)."""
    least = p.capture_speed + p.capture_spread * state.pad_deviate[leg]
    return meets(state, SPEED, max(normal_speed(state, rot, foot), 0.0), least)


@inner
def bonds(state: Any, p: Any, leg: int, push: float, impulse: float, upright: float) -> bool:
    """Whether a foot that presses against the ceiling takes hold.

    It has to be pushed hard enough (``minimum_preload`` of the legs and of ``foot_slip``), long enough
    (``pad_impulse``), and with its rod near enough to the ceiling's normal (``pad_angle``).

    Args:
        state, p: the vehicle. leg: index 0..3.
        push: N, at present. impulse: N s, of the push since the touch.
        upright: cosine of the angle between its rod and the normal.
    """
    z = state.pad_deviate[leg]
    return (
        meets(state, PUSH, push, p.minimum_preload + p.preload_spread * z)
        and meets(state, IMPULSE, impulse, p.pad_impulse + p.pad_impulse_spread * z)
        and meets(state, UPRIGHT, upright, uprightness(p.pad_angle - p.pad_angle_spread * z))
    )


@inner
def time_to_touch(state: Any, p: Any, rot: Rotation, horizon: float) -> float:
    """Time (s) until the next free foot meets the ceiling at its present velocity; `horizon` if none does."""
    soonest = horizon
    for leg in range(4):
        if state.foot_mode[leg] != FREE:
            continue
        foot = rest_foot(p, leg)
        gap = ceiling_gap(state, p, rot, foot)
        climb = normal_speed(state, rot, foot)
        if gap > 0.0 and climb * soonest > gap:
            soonest = gap / climb
    return soonest


@inner
def touch_feet(state: Any, p: Any, rot: Rotation) -> bool:
    """Let free feet at the ceiling or the floor take hold where they are; whether one met the ceiling."""
    position = state.position
    met = False
    for leg in range(4):
        mode = state.foot_mode[leg]
        if not can_touch(mode):
            continue
        foot = rest_foot(p, leg)
        fx, fy, fz = to_world(rot, foot[0], foot[1], foot[2])
        x, y, z = position[0] + fx, position[1] + fy, position[2] + fz
        gap = p.ceiling_z - p.foot_radius - z
        if mode == RELEASED:
            if gap > CLEARANCE:
                state.foot_mode[leg] = FREE
                state.foot_impulse[leg] = 0.0
            continue
        if gap <= TOGETHER:
            state.foot_mode[leg] = PRESSING_CEILING
            if not state.foot_refused[leg] and not sticks(state, p, rot, leg, foot):
                state.foot_refused[leg] = 1
            rod = p.leg_direction[leg]
            upright = to_world(rot, rod[0], rod[1], rod[2])[2]
            pressed = state.foot_impulse[leg]
            if not state.foot_refused[leg] and bonds(state, p, leg, 0.0, pressed, upright):
                state.foot_mode[leg] = ATTACHED
                state.foot_attached[leg] = 1
            met = True
        elif z <= p.foot_radius:
            state.foot_mode[leg] = PRESSING_FLOOR
            state.foot_refused[leg] = 0
            state.foot_impulse[leg] = 0.0
        else:
            if gap > CLEARANCE:
                state.foot_refused[leg] = 0
                state.foot_impulse[leg] = 0.0
            continue
        state.foot_anchor[leg, 0], state.foot_anchor[leg, 1], state.foot_anchor[leg, 2] = x, y, z
    return met


@inner
def hold_foot(
    p: Any, state: Any, leg: int, force: Vector, u: Vector, across: float, along: float, dt: float
) -> Vector:
    """What a touching foot holds of the force (N, world) that would keep it at its anchor.

    Changes the foot's mode where it takes hold or comes off, its anchor where it slides, and the impulse of
    its push.

    Args:
        p, state: the vehicle.
        leg: index 0..3.
        force: that would keep it (N, world).
        u: direction of the rod, world.
        across, along: see :func:`sim_backend.physics.sliding.slide`.
        dt: s, of the step.
    """
    mode = state.foot_mode[leg]
    if mode == ATTACHED:
        if force[2] > p.adhesion_strength:
            state.foot_mode[leg] = RELEASED
            state.foot_attached[leg] = 0
            return 0.0, 0.0, 0.0
        return force
    push = force[2] if mode == PRESSING_FLOOR else -force[2]
    if push <= 0.0:
        state.foot_mode[leg] = FREE
        return 0.0, 0.0, 0.0
    if mode == PRESSING_CEILING and not state.foot_refused[leg]:
        pressed = state.foot_impulse[leg] + dt * push
        if bonds(state, p, leg, push, pressed, u[2]):
            state.foot_mode[leg] = ATTACHED
            state.foot_attached[leg] = 1
            return force
    sign = 1.0 if mode == PRESSING_FLOOR else -1.0
    force, x, y = slide(p.foot_friction, force, sign, u, across, along)
    if force[2] == 0.0:
        state.foot_mode[leg] = FREE
    if mode == PRESSING_CEILING:
        state.foot_impulse[leg] -= dt * force[2]
    state.foot_anchor[leg, 0] += x
    state.foot_anchor[leg, 1] += y
    return force
