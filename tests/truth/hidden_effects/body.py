"""The vehicle between floor and ceiling, by RK4.

State: position 0..2, velocity 3..5, quaternion 6..9, body rate 10..12, rotor thrusts 13..16 (N), charge drawn
17 (C), coldness of the motors 18 (1: of the room). SI units; world ENU, body FLU with its origin in the
centre of mass.
"""

import math
from typing import Any

from tests.truth.hidden_effects.jit import Array, jitted
from tests.truth.hidden_effects.layout import AIR_DENSITY, GRAVITY, STATES
from tests.truth.hidden_effects.rotation import rotation, sum3
from tests.truth.hidden_effects.rotors import add_rotors, terminal_voltage, thrust_of


@jitted
def add_air(p: Any, y: Array, u: Array, force: Array, torque: Array) -> None:
    """Add what the air does to the body that moves at `u` (m/s, body frame) through it."""
    speed = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    for k in range(3):
        force[k] -= (p.linear_drag[k] + 0.5 * AIR_DENSITY * p.blunt_area[k] * speed) * u[k]
        torque[k] -= p.rate_damping[k] * y[10 + k]
    torque[0] += p.velocity_moment[0] * u[1]
    torque[1] -= p.velocity_moment[1] * u[0]


@jitted
def add_room(p: Any, t: float, y: Array, push: Array) -> float:
    """Add forces (N, world) of the tether and of the region; returns the line torque's sine."""
    if p.tether_stiffness > 0.0:
        dx, dy, dz = p.tether_end[0] - y[0], p.tether_end[1] - y[1], p.tether_end[2] - y[2]
        far = math.sqrt(dx * dx + dy * dy + dz * dz)
        if far > p.tether_length:
            growing = -(dx * y[3] + dy * y[4] + dz * y[5]) / far
            pull = max(p.tether_stiffness * (far - p.tether_length) + p.tether_damping * growing, 0.0)
            push[0] += pull * dx / far
            push[1] += pull * dy / far
            push[2] += pull * dz / far
    if p.region[0] < y[0] < p.region[1]:
        for k in range(3):
            push[k] += p.region_force[k]
    return math.sin(2.0 * math.pi * p.line_hertz * t)


@jitted
def add_contact(p: Any, y: Array, r: Array, push: Array, torque: Array) -> None:
    """Add the push of floor and ceiling on the hull's corners: springs, dampers, friction."""
    for i in range(8):
        bx, by, bz = p.corner[i, 0], p.corner[i, 1], p.corner[i, 2]
        z = y[2] + r[2, 0] * bx + r[2, 1] * by + r[2, 2] * bz
        side, depth = 1.0, -z
        if z > 0.5 * p.ceiling:
            side, depth = -1.0, z - p.ceiling
        if depth <= 0.0:
            continue
        cx, cy, cz = y[11] * bz - y[12] * by, y[12] * bx - y[10] * bz, y[10] * by - y[11] * bx
        sx = y[3] + r[0, 0] * cx + r[0, 1] * cy + r[0, 2] * cz
        sy = y[4] + r[1, 0] * cx + r[1, 1] * cy + r[1, 2] * cz
        sz = y[5] + r[2, 0] * cx + r[2, 1] * cy + r[2, 2] * cz
        load = max(p.floor_stiffness * depth - p.floor_damping * side * sz, 0.0)
        slip = math.sqrt(sx * sx + sy * sy + 1e-4)
        fx, fy, fz = -0.5 * load * sx / slip, -0.5 * load * sy / slip, side * load
        push[0] += fx
        push[1] += fy
        push[2] += fz
        gx = r[0, 0] * fx + r[1, 0] * fy + r[2, 0] * fz
        gy = r[0, 1] * fx + r[1, 1] * fy + r[2, 1] * fz
        gz = r[0, 2] * fx + r[1, 2] * fy + r[2, 2] * fz
        torque[0] += by * gz - bz * gy
        torque[1] += bz * gx - bx * gz
        torque[2] += bx * gy - by * gx


@jitted
def derivative(p: Any, t: float, y: Array, duty: Array, gust: Array, dy: Array, scratch: Array) -> None:
    """Time derivative `dy` of the state.

    `duty`: share of the battery voltage at each motor; `gust`: disturbing force (world) and torque (body).
    `scratch`, shape (8, 3): leaves the attitude's matrix in the first three rows, and in row 3 the specific
    force (m/s2, body) at the centre of mass.
    """
    r, felt, force, torque, u, push = scratch[:3], scratch[3], scratch[4], scratch[5], scratch[6], scratch[7]
    norm = math.sqrt(y[6] * y[6] + y[7] * y[7] + y[8] * y[8] + y[9] * y[9])
    rotation(y[6] / norm, y[7] / norm, y[8] / norm, y[9] / norm, r)
    volts = terminal_voltage(p, y)
    rates = dy[13:17]
    fresh = 1.0 + p.warming_loss * y[18]
    for i in range(4):
        told = thrust_of(p, duty[i] * volts)
        told = max(told * (1.0 + p.curvature * (told / p.hover_thrust - 1.0)), 0.0)
        told = min(p.gain[i] * fresh * told, p.thrust_limit)
        late = told - y[13 + i]
        rates[i] = late / (p.tau_up if late > 0.0 else p.tau_down)
    for k in range(3):
        force[k] = torque[k] = 0.0
        u[k] = sum3(r[0, k], r[1, k], r[2, k], y[3] - p.wind[0], y[4] - p.wind[1], y[5] - p.wind[2])
        push[k] = gust[k]
    add_rotors(p, y, r, u, rates, force, torque)
    add_air(p, y, u, force, torque)
    wave = add_room(p, t, y, push)
    if not 0.1 < y[2] < p.ceiling - 0.1:
        add_contact(p, y, r, push, torque)
    for k in range(3):
        force[k] += r[0, k] * push[0] + r[1, k] * push[1] + r[2, k] * push[2]
        torque[k] += gust[3 + k] + p.trim[k] + p.line_torque[k] * wave
        felt[k] = force[k] / p.mass
    for k in range(3):
        dy[k] = y[3 + k]
        dy[3 + k] = sum3(r[k, 0], r[k, 1], r[k, 2], felt[0], felt[1], felt[2])
    dy[5] -= GRAVITY
    a, b, c, d = y[6], y[7], y[8], y[9]
    wx, wy, wz = y[10], y[11], y[12]
    dy[6] = 0.5 * (d * wx + b * wz - c * wy)
    dy[7] = 0.5 * (d * wy + c * wx - a * wz)
    dy[8] = 0.5 * (d * wz + a * wy - b * wx)
    dy[9] = -0.5 * (a * wx + b * wy + c * wz)
    i0, i1, i2 = p.inertia[0], p.inertia[1], p.inertia[2]
    dy[10] = (torque[0] + (i1 - i2) * wy * wz) / i0
    dy[11] = (torque[1] + (i2 - i0) * wz * wx) / i1
    dy[12] = (torque[2] + (i0 - i1) * wx * wy) / i2
    dy[17] = p.amps_per_newton * (y[13] + y[14] + y[15] + y[16])
    # One temperature for all motors; what heats them is the power of the rotors, thrust to the power of 1.5.
    load = max(y[13] + y[14] + y[15] + y[16], 0.0) / (4.0 * p.hover_thrust)
    dy[18] = (1.0 - load * math.sqrt(load) - y[18]) / p.warming_time


@jitted
def runge_kutta(
    p: Any, t: float, y: Array, duty: Array, gust: Array, h: float, work: Array, scratch: Array
) -> None:
    """Advance the state `y` by `h` (s) in place; classical fourth order. `work`: (5, STATES)."""
    derivative(p, t, y, duty, gust, work[0], scratch)
    for n in range(STATES):
        work[4, n] = y[n] + 0.5 * h * work[0, n]
    derivative(p, t + 0.5 * h, work[4], duty, gust, work[1], scratch)
    for n in range(STATES):
        work[4, n] = y[n] + 0.5 * h * work[1, n]
    derivative(p, t + 0.5 * h, work[4], duty, gust, work[2], scratch)
    for n in range(STATES):
        work[4, n] = y[n] + h * work[2, n]
    derivative(p, t + h, work[4], duty, gust, work[3], scratch)
    for n in range(STATES):
        y[n] += h / 6.0 * (work[0, n] + 2.0 * work[1, n] + 2.0 * work[2, n] + work[3, n])
    norm = math.sqrt(y[6] * y[6] + y[7] * y[7] + y[8] * y[8] + y[9] * y[9])
    for n in range(6, 10):
        y[n] /= norm
