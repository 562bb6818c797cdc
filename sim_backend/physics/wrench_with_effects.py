"""Force and torque of free flight with effects: rotors one by one, then the body as a whole.

Rotors need their speed, w = sqrt(F / k_f), and the motion of their own hub through the air; both are found
once. An effect that a vehicle does not have is here with parameters that do nothing.
"""

from typing import Any

import numpy as np

from sim_backend.physics.air import linear_drag
from sim_backend.physics.effects.body_drag import body_drag
from sim_backend.physics.effects.ceiling_effect import ceiling_gain
from sim_backend.physics.effects.ground_effect import ground_gain
from sim_backend.physics.effects.inflow_thrust_loss import inflow_loss
from sim_backend.physics.effects.rate_damping import damping_torque
from sim_backend.physics.effects.rotor_acceleration_torque import acceleration_torque
from sim_backend.physics.effects.rotor_drag import rotor_drag
from sim_backend.physics.effects.rotor_gyroscopic import gyroscopic_torque
from sim_backend.physics.effects.tether import tether_force
from sim_backend.physics.effects.translational_lift import lift_gain
from sim_backend.physics.effects.velocity_moment import velocity_moment
from sim_backend.physics.effects.wind import through_the_air
from sim_backend.physics.frames import Rotation, Wrench, to_body
from sim_backend.physics.jit import inner, outlined
from sim_backend.physics.motors import rotor_speed

RotorWrench = tuple[float, float, float, float, float, float, float]

MOTORS: Any = tuple(np.int64(motor) for motor in range(4))
"""Indices of the motors; not plain integers: one compiled function serves all (:mod:`onboard.jit`)."""


@inner
def rotor(
    state: Any, p: Any, rot: Rotation, motor: int, sign: float, ux: float, uy: float, uz: float
) -> RotorWrench:
    """Wrench of one rotor (body frame), and its signed speed (rad/s)."""
    x, y, z = p.hub[motor, 0], p.hub[motor, 1], p.hub[motor, 2]
    wx, wy, wz = state.omega[0], state.omega[1], state.omega[2]
    lean = p.thrust_lean
    still = state.thrust[motor]
    speed = rotor_speed(state, p, motor)
    hub_z = state.position[2] + rot[6] * x + rot[7] * y + rot[8] * z
    ax, ay, az = ux + wy * z - wz * y, uy + wz * x - wx * z, uz + wx * y - wy * x
    thrust = still * ceiling_gain(p, p.ceiling_z - hub_z, rot[8]) * ground_gain(p, hub_z, rot[8])
    thrust = thrust * lift_gain(p, still, ax * ax + ay * ay) - inflow_loss(p, speed, az)
    dx, dy = rotor_drag(p, speed, ax, ay)
    fx, fy, fz = thrust * lean[0] + dx, thrust * lean[1] + dy, thrust + thrust * lean[2]
    # The drag torque of a propeller goes with its speed, not with what a surface adds to its thrust.
    tz = x * fy - y * fx - sign * p.thrust_to_torque * still
    return fx, fy, fz, y * fz - z * fy, z * fx - x * fz, tz, sign * speed


@inner
def sum_of(a: RotorWrench, b: RotorWrench) -> RotorWrench:
    """Sum of two rotors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5], a[6] + b[6]


@inner
def rotors(state: Any, p: Any, rot: Rotation, ux: float, uy: float, uz: float) -> RotorWrench:
    """Wrench of the four rotors (body frame), and the sum w1 - w2 + w3 - w4 of their speeds (rad/s).

    `ux`, `uy`, `uz`: velocity of the body through the air, body frame, m/s.
    """
    return sum_of(
        sum_of(
            rotor(state, p, rot, MOTORS[0], 1.0, ux, uy, uz),
            rotor(state, p, rot, MOTORS[1], -1.0, ux, uy, uz),
        ),
        sum_of(
            rotor(state, p, rot, MOTORS[2], 1.0, ux, uy, uz),
            rotor(state, p, rot, MOTORS[3], -1.0, ux, uy, uz),
        ),
    )


@outlined
def wrench_with_effects(state: Any, p: Any, rot: Rotation, vx: float, vy: float, vz: float) -> Wrench:
    """Force (N) and torque (N m) on the body in the body frame, as ``forces.free_flight_wrench``."""
    wx, wy, wz = state.omega[0], state.omega[1], state.omega[2]
    ux, uy, uz = through_the_air(p, rot, vx, vy, vz)
    fx, fy, fz, tx, ty, tz, spin = rotors(state, p, rot, ux, uy, uz)
    linear = linear_drag(state, p, ux, uy, uz)
    blunt = body_drag(p, ux, uy, uz)
    pull = tether_force(state, p)
    string = to_body(rot, pull[0], pull[1], pull[2])
    moment = velocity_moment(p, ux, uy)
    damping = damping_torque(p, wx, wy, wz)
    gyroscopic = gyroscopic_torque(p, spin, wx, wy)
    return (
        fx + linear[0] + blunt[0] + string[0],
        fy + linear[1] + blunt[1] + string[1],
        fz + linear[2] + blunt[2] + string[2],
        tx + moment[0] + damping[0] + gyroscopic[0],
        ty + moment[1] + damping[1] + gyroscopic[1],
        tz + damping[2] + acceleration_torque(state, p),
    )
