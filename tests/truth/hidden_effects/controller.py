"""The drone's own estimate and controller: position, attitude and rate loop, mixer, battery."""

import math
from typing import Any

import numpy as np

from tests.truth.hidden_effects.jit import Array, jitted
from tests.truth.hidden_effects.layout import CONTROL_PERIOD, FULL, GRAVITY, Setpoint
from tests.truth.hidden_effects.rotation import attitude_error, rotation, sum3, turn, wrap
from tests.truth.hidden_effects.rotors import voltage_for

FASTEST = 1.2
"""m/s, at which the drone closes a gap to its set-point."""
NEAR = (0.5, 0.5, 0.15)
"""m, from the set-point, within which the position's integrals run."""

# Plain integers: numba compiles them in as constants.
_X, _VX, _AX, _YAW = int(Setpoint.X), int(Setpoint.VX), int(Setpoint.AX), int(Setpoint.YAW)
_ROLL, _PITCH = int(Setpoint.ROLL), int(Setpoint.PITCH)
_P, _Q, _R = int(Setpoint.P), int(Setpoint.Q), int(Setpoint.R)
_COLLECTIVE, _ARMED = int(Setpoint.COLLECTIVE), int(Setpoint.ARMED)


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
