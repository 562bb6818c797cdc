"""The compiled world of the hidden flights: vehicle, air and floor by RK4, and the drone's own controller.

One file, because numba's cache does not see changes of functions imported from another. Nothing here comes
from the simulation that the gap finder uses. SI units; world ENU, body FLU with its origin in the centre of
mass, quaternions scalar-last. State: position 0..2, velocity 3..5, quaternion 6..9, body rate 10..12, rotor
thrusts 13..16 (N), charge drawn 17 (C).
"""

import math
from typing import Any

import numpy as np
from numba import njit

from tests.gap.truth.layout import (
    CONTROL_PERIOD,
    GRAVITY,
    MAP_CUBIC,
    MAP_QUADRATIC,
    STATES,
    SUBSTEPS,
    TICKS_PER_SAMPLE,
    Setpoint,
)

AIR_DENSITY = 1.2
FULL = 65535.0
MOST_GROUND_GAIN = 2.0
FASTEST = 1.2
"""m/s, at which the drone closes a gap to its set-point."""
NEAR = (0.5, 0.5, 0.15)
"""m, from the set-point, within which the position's integrals run."""

Array = np.ndarray

# Plain integers: numba compiles them in as constants.
_X, _VX, _AX, _YAW = int(Setpoint.X), int(Setpoint.VX), int(Setpoint.AX), int(Setpoint.YAW)
_ROLL, _PITCH = int(Setpoint.ROLL), int(Setpoint.PITCH)
_P, _Q, _R = int(Setpoint.P), int(Setpoint.Q), int(Setpoint.R)
_COLLECTIVE, _ARMED = int(Setpoint.COLLECTIVE), int(Setpoint.ARMED)

jitted = njit(cache=True, nogil=True, error_model="numpy")


@jitted
def thrust_of(p: Any, volt: float) -> float:
    """Settled thrust (N) of a motor at a voltage (V)."""
    c = p.map
    if volt <= 0.0:
        return 0.0
    if p.map_form == MAP_QUADRATIC:
        low = (c[0] * volt + c[1]) * volt + c[2]
        high = (c[3] * volt + c[4]) * volt + c[5]
        if low < c[6]:  # the rows do not meet: the thrust waits at the break
            return max(low, 0.0)
        return max(high, c[6]) if volt > -0.5 * c[4] / c[3] else c[6]
    if p.map_form == MAP_CUBIC:
        return max(((c[3] * volt + c[2]) * volt + c[1]) * volt + c[0], 0.0)
    knee = c[0] * math.log1p(c[4] / c[1])
    if volt < knee:
        return c[1] * math.expm1(volt / c[0])
    return c[4] + (c[4] + c[3]) * math.expm1((volt - knee) / c[2])


@jitted
def settled_thrusts(p: Any, logged: Array) -> Array:
    """Thrusts (N) that motors head for at logged PWM and voltage (rows of m1..m4, vbat), shape (n, 4)."""
    out = np.empty((logged.shape[0], 4))
    for n in range(logged.shape[0]):
        for i in range(4):
            out[n, i] = thrust_of(p, logged[n, i] / FULL * logged[n, 4])
    return out


@jitted
def voltage_for(p: Any, thrust: float) -> float:
    """Motor voltage (V) that the controller takes for a thrust (N): table of the nominal map."""
    last = p.inverse.size - 1
    place = min(max(thrust / p.inverse_step, 0.0), last - 1e-9)
    k = int(place)
    return p.inverse[k] + (place - k) * (p.inverse[k + 1] - p.inverse[k])


@jitted
def terminal_voltage(p: Any, y: Array) -> float:
    """Battery voltage (V) under the load of the four rotors."""
    current = p.amps_per_newton * (y[13] + y[14] + y[15] + y[16])
    return p.full_volts - p.volts_per_coulomb * y[17] - p.ohms * current


@jitted
def rotation(x: float, y: float, z: float, w: float, r: Array) -> None:
    """Matrix body to world of a unit quaternion."""
    r[0, 0], r[0, 1], r[0, 2] = w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)
    r[1, 0], r[1, 1], r[1, 2] = 2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)
    r[2, 0], r[2, 1], r[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z


@jitted
def surface_gain(p: Any, height: float, up: float) -> float:
    """Thrust near floor and ceiling over that in the open, for a hub at `height` (m), cosine of tilt `up`."""
    if up <= 0.0:
        return 1.0
    gain = 1.0
    if p.ceiling_inflow > 0.0:
        ratio = p.rotor_radius / (p.ceiling_opening * max(p.ceiling - height, 1e-6))
        b = p.ceiling_inflow / (0.5 * (1.0 + math.sqrt(1.0 + 0.125 * ratio * ratio)))
        root = 0.5 * (math.sqrt(b * b + 4.0 * (1.0 + p.ceiling_inflow)) - b)
        gain += up * (root * root - 1.0)
    if p.ground_strength > 0.0:
        mirror = p.ground_strength * (p.rotor_radius / (4.0 * max(height, 1e-6))) ** 2
        closest = 1.0 - 1.0 / MOST_GROUND_GAIN
        gain *= 1.0 + up * (1.0 / (1.0 - min(mirror, closest)) - 1.0)
    return gain


@jitted
def fresh_air_gain(p: Any, still: float, edgewise: float) -> float:
    """Thrust of a rotor that moves edgewise (m/s) over that in still air: Glauert's inflow, blade lift."""
    if p.lift_inflow == 0.0 or still <= 0.0:
        return 1.0
    hover = math.sqrt(still / (2.0 * AIR_DENSITY * math.pi)) / p.rotor_radius
    induced = hover
    for _ in range(40):  # halfway to the next estimate: it converges at any speed
        induced = 0.5 * (induced + hover * hover / math.sqrt(edgewise * edgewise + induced * induced))
    gain = 1.0
    for _ in range(20):  # Newton's method for gain + c sqrt(gain) = 1 + inflow
        c = p.lift_inflow * induced / hover
        gain -= (gain + c * math.sqrt(gain) - 1.0 - p.lift_inflow) / (1.0 + 0.5 * c / math.sqrt(gain))
    return gain


@jitted
def add_rotors(
    p: Any, y: Array, r: Array, wind_body: Array, rates: Array, force: Array, torque: Array
) -> None:
    """Add force and torque (body frame) of the rotors; `rates`: dF/dt of each (N/s)."""
    spin_sum, spin_change = 0.0, 0.0
    for i in range(4):
        hx, hy, hz = p.hub[i, 0], p.hub[i, 1], p.hub[i, 2]
        ux = wind_body[0] + y[11] * hz - y[12] * hy
        uy = wind_body[1] + y[12] * hx - y[10] * hz
        uz = wind_body[2] + y[10] * hy - y[11] * hx
        still = max(y[13 + i], 0.0)
        speed = math.sqrt(still / p.thrust_per_speed2)
        height = y[2] + r[2, 0] * hx + r[2, 1] * hy + r[2, 2] * hz
        fresh = fresh_air_gain(p, still, math.hypot(ux, uy))
        lift = still * surface_gain(p, height, r[2, 2]) * fresh - p.inflow_loss * speed * uz
        fx = lift * p.axis[0] - p.rotor_drag * speed * ux
        fy = lift * p.axis[1] - p.rotor_drag * speed * uy
        fz = lift * p.axis[2]
        force[0] += fx
        force[1] += fy
        force[2] += fz
        torque[0] += hy * fz - hz * fy
        torque[1] += hz * fx - hx * fz
        turning = 1.0 if i % 2 == 0 else -1.0  # M1 and M3 counter-clockwise from above
        torque[2] += hx * fy - hy * fx - turning * p.drag_torque * still
        spin_sum += turning * speed
        spin_change += turning * rates[i] / (2.0 * math.sqrt(p.thrust_per_speed2 * max(still, 1e-4)))
    torque[0] -= p.gyroscopic_inertia * spin_sum * y[11]
    torque[1] += p.gyroscopic_inertia * spin_sum * y[10]
    torque[2] -= p.accelerated_inertia * spin_change


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
    for i in range(4):
        told = thrust_of(p, duty[i] * volts)
        told = max(told * (1.0 + p.curvature * (told / p.hover_thrust - 1.0)), 0.0)
        told = min(p.gain[i] * told, p.thrust_limit)
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


@jitted
def sum3(a: float, b: float, c: float, x: float, y: float, z: float) -> float:
    return a * x + b * y + c * z


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


@jitted
def turn(q: Array, x: float, y: float, z: float) -> None:
    """Turn the quaternion `q` in place by the rotation vector (x, y, z) in its own frame."""
    angle = math.sqrt(x * x + y * y + z * z)
    s = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    c = math.cos(0.5 * angle)
    x, y, z = s * x, s * y, s * z
    a, b, d, w = q[0], q[1], q[2], q[3]
    q[0] = w * x + a * c + b * z - d * y
    q[1] = w * y + b * c + d * x - a * z
    q[2] = w * z + d * c + a * y - b * x
    q[3] = w * c - a * x - b * y - d * z


@jitted
def attitude_error(q: Array, m: Array, out: Array) -> None:
    """Rotation vector (small angles) from the attitude `q` to `m`, in the frame of `q`."""
    s = 2.0 if q[0] * m[0] + q[1] * m[1] + q[2] * m[2] + q[3] * m[3] > 0.0 else -2.0
    out[0] = s * (q[3] * m[0] - q[0] * m[3] - q[1] * m[2] + q[2] * m[1])
    out[1] = s * (q[3] * m[1] - q[1] * m[3] - q[2] * m[0] + q[0] * m[2])
    out[2] = s * (q[3] * m[2] - q[2] * m[3] - q[0] * m[1] + q[1] * m[0])


@jitted
def estimate(e: Array, r: Array, gyro: Array, accelerometer: Array, fresh: bool, pose: Array) -> None:
    """The drone's estimate `e`: position 0..2, velocity 3..5, attitude 6..9; corrected by a `fresh` pose."""
    dt = CONTROL_PERIOD
    turn(e[6:10], dt * gyro[0], dt * gyro[1], dt * gyro[2])
    rotation(e[6], e[7], e[8], e[9], r)
    for k in range(3):
        rise = sum3(r[k, 0], r[k, 1], r[k, 2], accelerometer[0], accelerometer[1], accelerometer[2])
        if k == 2:
            rise -= GRAVITY
        e[k] += dt * e[3 + k]
        e[3 + k] += dt * rise
        if fresh:
            miss = pose[k] - e[k]
            e[k] += 0.3 * miss
            e[3 + k] += 5.0 * miss
    if fresh:
        miss3 = np.empty(3)
        attitude_error(e[6:10], pose[3:7], miss3)
        turn(e[6:10], 0.1 * miss3[0], 0.1 * miss3[1], 0.1 * miss3[2])


@jitted
def wrap(angle: float) -> float:
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@jitted
def wanted_acceleration(p: Any, e: Array, memory: Array, s: Array, out: Array) -> None:
    """Position and velocity loop: acceleration (m/s2, world) in `out` for the set-point row `s`."""
    g = p.gains
    for k in range(3):
        miss = s[_X + k] - e[k]
        if abs(miss) < NEAR[k]:
            memory[k] = min(max(memory[k] + CONTROL_PERIOD * miss, -1.0), 1.0)
        o = 3 * (k == 2)
        most = FASTEST * g[o + 1]
        a = min(max(g[o] * miss, -most), most) + g[o + 1] * (s[_VX + k] - e[3 + k])
        a += g[o + 2] * memory[k] + s[_AX + k]
        out[k] = min(max(a, -6.0), 6.0 if k < 2 else 5.0)


@jitted
def wanted_rates(p: Any, r: Array, s: Array, acceleration: Array, out: Array) -> float:
    """Attitude loop: rates (rad/s, body) in `out`; returns the collective thrust (N)."""
    yaw = math.atan2(r[1, 0], r[0, 0])
    pitch = math.asin(min(max(-r[2, 0], -1.0), 1.0))
    roll = math.atan2(r[2, 1], r[2, 2])
    forward = math.cos(yaw) * acceleration[0] + math.sin(yaw) * acceleration[1]
    left = -math.sin(yaw) * acceleration[0] + math.cos(yaw) * acceleration[1]
    up = acceleration[2] + GRAVITY
    wanted_pitch = math.atan2(forward, up) + s[_PITCH]
    wanted_roll = -math.atan2(left, math.hypot(forward, up)) + s[_ROLL]
    out[0] = p.gains[6] * (wanted_roll - roll) + s[_P]
    out[1] = p.gains[6] * (wanted_pitch - pitch) + s[_Q]
    out[2] = p.gains[7] * wrap(s[_YAW] - yaw) + s[_R]
    if s[_COLLECTIVE] >= 0.0:
        return p.filed_mass * GRAVITY * s[_COLLECTIVE]
    return p.filed_mass * up / max(r[2, 2], 0.6)


@jitted
def wanted_torques(p: Any, rates: Array, gyro: Array, memory: Array, out: Array) -> None:
    """Rate loop: torques (N m, body) in `out`."""
    for k in range(3):
        o = 8 + 3 * (k == 2)
        slope = p.rate_filter * (gyro[k] - memory[6 + k]) / CONTROL_PERIOD
        memory[6 + k] += slope * CONTROL_PERIOD
        miss = rates[k] - gyro[k]
        memory[3 + k] = min(max(memory[3 + k] + CONTROL_PERIOD * miss, -3.0), 3.0)
        wanted = p.gains[o] * miss + p.gains[o + 1] * memory[3 + k] - p.gains[o + 2] * slope
        out[k] = p.filed_inertia[k] * wanted


@jitted
def mix(p: Any, collective: float, torque: Array, thrusts: Array) -> None:
    """Thrusts (N) of the motors; where one would exceed its limit, all give up collective."""
    base, tx, ty = 0.25 * collective, 0.25 * torque[0] / p.filed_arm[1], 0.25 * torque[1] / p.filed_arm[0]
    tz = min(max(0.25 * torque[2] / p.drag_torque, -0.02), 0.02)
    thrusts[0] = base - tx - ty - tz
    thrusts[1] = base - tx + ty + tz
    thrusts[2] = base + tx + ty - tz
    thrusts[3] = base + tx - ty + tz
    over = max(thrusts[0], thrusts[1], thrusts[2], thrusts[3]) - p.thrust_ceiling
    for i in range(4):
        thrusts[i] = min(max(thrusts[i] - max(over, 0.0), p.thrust_floor), p.thrust_ceiling)


@jitted
def control(p: Any, e: Array, gyro: Array, volts: float, memory: Array, s: Array, pwm: Array) -> None:
    """Cascade position - attitude - rate, mixer and battery compensation: `pwm` counts for the row `s`.

    `memory`: integrals of position 0..2 and of the rates 3..5, smoothed gyro 6..8; cleared while disarmed.
    """
    if s[_ARMED] <= 0.0:
        memory[:] = 0.0
        pwm[:] = 0.0
        return
    r, three, rates, thrusts = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(4)
    rotation(e[6], e[7], e[8], e[9], r)
    wanted_acceleration(p, e, memory, s, three)
    collective = wanted_rates(p, r, s, three, rates)
    wanted_torques(p, rates, gyro, memory, three)
    mix(p, collective, three, thrusts)
    for i in range(4):
        share = min(max(voltage_for(p, thrusts[i]) / volts, 0.0), 1.0)
        pwm[i] = math.floor(FULL * share + 0.5)


@jitted
def seen_pose(p: Any, states: Array, now: float, pose: Array) -> None:
    """What the motion capture reports (noiseless) at tick `now` (may be a fraction): `pose`, 7 numbers."""
    now = max(now, 0.0)
    k = min(int(now), states.shape[0] - 2) if states.shape[0] > 1 else 0
    f = now - k
    a, b = states[k], states[k + (1 if f > 0.0 else 0)]
    for n in range(4):
        pose[3 + n] = a[6 + n] + f * (b[6 + n] - a[6 + n])
    norm = math.sqrt(pose[3] ** 2 + pose[4] ** 2 + pose[5] ** 2 + pose[6] ** 2)
    r = np.empty((3, 3))
    rotation(pose[3] / norm, pose[4] / norm, pose[5] / norm, pose[6] / norm, r)
    t = p.tracked
    for n in range(3):
        pose[n] = a[n] + f * (b[n] - a[n]) + sum3(r[n, 0], r[n, 1], r[n, 2], t[0], t[1], t[2])
    for n in range(3, 7):
        pose[n] /= norm
    turn(pose[3:7], p.pose_turn[0], p.pose_turn[1], p.pose_turn[2])


@jitted
def blur(p: Any, noise: Array, pose: Array) -> None:
    """Add the motion capture's noise to a `pose`: position 0..2 and rotation vector 3..5, standard normal."""
    for k in range(3):
        pose[k] += p.position_noise * noise[k]
    a = p.attitude_noise
    turn(pose[3:7], a * noise[3], a * noise[4], a * noise[5])


@jitted
def inertial(
    p: Any, y: Array, dy: Array, scratch: Array, noise: Array, gyro: Array, accelerometer: Array
) -> None:
    """Gyro and accelerometer, which sit at `imu` from the centre of mass, with noise and bias, in counts."""
    wx, wy, wz, c = y[10], y[11], y[12], p.imu
    dot = wx * c[0] + wy * c[1] + wz * c[2]
    square = wx * wx + wy * wy + wz * wz
    swing0 = dy[11] * c[2] - dy[12] * c[1] + wx * dot - square * c[0]
    swing1 = dy[12] * c[0] - dy[10] * c[2] + wy * dot - square * c[1]
    swing2 = dy[10] * c[1] - dy[11] * c[0] + wz * dot - square * c[2]
    for k in range(3):
        swing = swing0 if k == 0 else (swing1 if k == 1 else swing2)
        a = scratch[3, k] + swing + p.accelerometer_bias[k] + p.accelerometer_noise * noise[3 + k]
        w = y[10 + k] + p.gyro_bias[k] + p.gyro_noise * noise[k]
        accelerometer[k] = p.accelerometer_count * math.floor(a / p.accelerometer_count + 0.5)
        gyro[k] = p.gyro_count * math.floor(w / p.gyro_count + 0.5)


@jitted
def fly(
    p: Any,
    start: Array,
    setpoints: Array,
    gusts: Array,
    noise: Array,
    pose_noise: Array,
    states: Array,
    log: Array,
) -> None:
    """One flight in closed loop.

    Args:
        p: record of `layout.PARAMETERS`.
        start: state, shape (STATES,).
        setpoints: per control tick, shape (n, len(Setpoint)).
        gusts: disturbing force (N, world) and torque (N m, body) per tick, shape (n, 6).
        noise: standard normal numbers per tick for gyro, accelerometer, voltage, shape (n, 7).
        pose_noise: per sample, of position (3) and rotation vector (3), standard normal, shape (m, 6).
        states: filled with the true state at every tick, shape (n, STATES).
        log: filled per sample: pose 7, gyro 3, accelerometer 3, PWM 4, voltage, shape (m, 18).
    """
    ticks = setpoints.shape[0]
    y, dy, work, scratch = start.copy(), np.zeros(STATES), np.zeros((5, STATES)), np.zeros((8, 3))
    e, memory, r = np.zeros(10), np.zeros(9), np.empty((3, 3))
    gyro, accelerometer, pose = np.zeros(3), np.zeros(3), np.zeros(7)
    applied, counts = np.zeros(4), np.zeros((ticks, 4))
    volts = terminal_voltage(p, y)
    for n in range(ticks):
        states[n] = y
        t = n * CONTROL_PERIOD
        derivative(p, t, y, applied, gusts[n], dy, scratch)
        inertial(p, y, dy, scratch, noise[n], gyro, accelerometer)
        measured = terminal_voltage(p, y) + p.voltage_noise * noise[n, 6]
        volts += 0.04 * (measured - volts)
        fresh = n % TICKS_PER_SAMPLE == 0
        if fresh:
            m = n // TICKS_PER_SAMPLE
            seen_pose(p, states[: n + 1], n - p.pose_delay / CONTROL_PERIOD, pose)
            blur(p, pose_noise[m], pose)
        if n == 0:
            e[:3] = pose[:3]
            e[6:10] = pose[3:7]
        estimate(e, r, gyro, accelerometer, fresh, pose)
        control(p, e, gyro, volts, memory, setpoints[n], counts[n])
        if fresh:
            log[m, :7] = pose
            log[m, 7:10] = gyro
            log[m, 10:13] = accelerometer
            log[m, 13:17] = counts[n]
            log[m, 17] = measured
        h = CONTROL_PERIOD / SUBSTEPS
        for k in range(SUBSTEPS):
            sent = math.floor((n * CONTROL_PERIOD + k * h - p.command_delay) / CONTROL_PERIOD + 1e-6)
            for i in range(4):
                applied[i] = counts[int(sent), i] / FULL if sent >= 0 else 0.0
            runge_kutta(p, t + k * h, y, applied, gusts[n], h, work, scratch)
