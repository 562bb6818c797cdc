"""One flight of the true vehicle with the drone's own controller, compiled.

Nothing here comes from the simulation that the gap finder uses.
"""

import math
from typing import Any

import numpy as np

from tests.truth.hidden_effects.body import derivative, runge_kutta
from tests.truth.hidden_effects.controller import control, estimate
from tests.truth.hidden_effects.jit import Array, jitted
from tests.truth.hidden_effects.layout import CONTROL_PERIOD, FULL, STATES, SUBSTEPS, TICKS_PER_SAMPLE
from tests.truth.hidden_effects.rotors import terminal_voltage
from tests.truth.hidden_effects.sensors import blur, inertial, seen_pose


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
