"""Force and torque of free flight with effects: rotors one by one, then the body as a whole.

Rotors need their speed, w = sqrt(F / k_f), and the motion of their own hub through the air; both are found
once. An effect that a vehicle does not have is here with parameters that do nothing.
"""

import math
from typing import Any

from onboard.jit import kernel, outlined
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
from sim_backend.physics.effects.velocity_moment import velocity_moment
from sim_backend.physics.effects.wind import through_the_air
from sim_backend.physics.frames import Rotation, to_body
from sim_backend.physics.motors import Wrench


@kernel
def rotors(
    state: Any, p: Any, rot: Rotation, ux: float, uy: float, uz: float
) -> tuple[float, float, float, float, float, float, float]:
    """Wrench of the four rotors (body frame), and the sum w1 - w2 + w3 - w4 of their speeds (rad/s).

    `ux`, `uy`, `uz`: velocity of the body through the air, body frame, m/s.
    """
    wx, wy, wz = state.omega[0], state.omega[1], state.omega[2]
    height, lean, thrusts = state.position[2], p.thrust_lean, state.thrust
    fx, fy, fz, tx, ty, tz, spin = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    sign = 1.0
    for motor in range(4):
        x, y, z = p.hub[motor, 0], p.hub[motor, 1], p.hub[motor, 2]
        still = thrusts[motor]
        speed = math.sqrt(still * p.speed2_per_thrust)
        hub_z = height + rot[6] * x + rot[7] * y + rot[8] * z
        thrust = still * ceiling_gain(p, p.ceiling_z - hub_z, rot[8]) * ground_gain(p, hub_z, rot[8])
        thrust -= inflow_loss(p, speed, uz + wx * y - wy * x)
        dx, dy = rotor_drag(p, speed, ux + wy * z - wz * y, uy + wz * x - wx * z)
        gx, gy, gz = thrust * lean[0] + dx, thrust * lean[1] + dy, thrust + thrust * lean[2]
        fx, fy, fz = fx + gx, fy + gy, fz + gz
        tx += y * gz - z * gy
        ty += z * gx - x * gz
        # The drag torque of a propeller goes with its speed, not with what a surface adds to its thrust.
        tz += x * gy - y * gx - sign * p.thrust_to_torque * still
        spin += sign * speed
        sign = -sign
    return fx, fy, fz, tx, ty, tz, spin


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
