"""A quadrotor of kilograms in the steady wind of a fan array, or in none: 50 lines a second, no voltage.

What its author chose otherwise than the simulation: rotation matrices and Runge and Kutta's fourth-order
rule, rotors that follow their speed and not their thrust, drag of the whole body at its centre of mass (in
proportion to the speed, or to its square), cascaded PID loops at 250 Hz; the log has poses, rates and duties.
"""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from onboard.vehicle import Vehicle
from tests.truth import airframe
from tests.truth.airframe import Airframe, G
from tests.truth.jit import jitted

STEP, PER_TICK, PER_LINE = 1e-3, 4, 20
"""s, of the integrator; steps to a tick of the controller, and to a line of the log."""
SECONDS = 36.0
FULL_VOLTAGE = 22.2
Array = np.ndarray


class Truth(NamedTuple):
    """What flies, and in what: SI units; `linear` and `square` are drag coefficients (N s/m, N s2/m2)."""

    mass: float
    arm: float
    ix: float
    iy: float
    iz: float
    kf: float
    yaw_lever: float
    fastest: float
    lag: float
    linear: float
    square: float
    wind_x: float
    wind_y: float
    gust: float
    tilt_x: float
    tilt_y: float

    def force_in_wind(self, velocity: Array) -> Array:
        """Drag (N, world) on the level vehicle at a horizontal velocity (m/s)."""
        u = np.asarray(velocity) - (self.wind_x, self.wind_y)
        return -(self.linear + self.square * np.linalg.norm(u)) * u


def draw(seed: int, speed: float) -> Truth:
    """A vehicle of 1.2 to 4.5 kg in a wind of `speed` (m/s) from a random direction."""
    rng = np.random.default_rng([seed, 7])
    mass = float(np.exp(rng.uniform(math.log(1.2), math.log(4.5))))
    arm = 0.25 * (mass / 2.5) ** (1.0 / 3.0) * float(rng.uniform(0.85, 1.15))
    inertia = 0.055 * mass * arm**2 * 4.0 * rng.uniform(0.8, 1.2)
    hover = float(rng.uniform(380.0, 620.0))
    kf = mass * G / 4.0 / hover**2
    drag = mass * float(rng.uniform(0.2, 0.4))
    square = bool(rng.integers(2)) and speed > 0.0
    angle = float(rng.uniform(-math.pi, math.pi))
    return Truth(
        mass, arm, inertia, inertia * float(rng.uniform(0.9, 1.2)), 1.8 * inertia, kf, 0.018, hover * 1.55,
        float(rng.uniform(0.03, 0.07)),
        0.0 if square else drag, drag / max(speed, 1.0) if square else 0.0,
        speed * math.cos(angle), speed * math.sin(angle), 0.05 * speed, 0.0, 0.0,
    )  # fmt: skip


def nominal(truth: Truth) -> Vehicle:
    """The vehicle file that an owner would have."""
    return airframe.nominal(
        Airframe(
            truth.mass, truth.arm, truth.ix, truth.iy, truth.iz, truth.kf, truth.fastest,
            truth.lag, truth.lag, truth.yaw_lever, FULL_VOLTAGE, 3.0, 20000.0, 0.02, 0.7,
        ),
        "tunnel",
    )  # fmt: skip


def make_flights(truth: Truth, seed: int, flights: int, out: Path) -> list[Path]:
    """Fly and write logs of the `table` format; figures of eight and ovals at several sizes and speeds."""
    out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, 11])
    paths = []
    for number in range(flights):
        figure = np.array(
            [rng.uniform(0.8, 1.6), rng.uniform(0.6, 1.2), rng.uniform(4.5, 9.0), rng.choice([1.0, 2.0]),
             rng.uniform(0.0, 0.3), rng.uniform(-0.6, 0.6), rng.uniform(0.0, 2.0 * math.pi)]
        )  # fmt: skip
        lines = round(SECONDS / STEP) // PER_LINE
        log = np.empty((lines, 18))
        noise = rng.standard_normal((lines * PER_LINE, 8))
        fly(np.array(truth), figure, noise, log)
        log[:, 1:4] += 5e-4 * rng.standard_normal((lines, 3))
        log[:, 8:11] += 2e-3 * rng.standard_normal((lines, 3))
        names = "t,x,y,z,qx,qy,qz,qw,gx,gy,gz,m1,m2,m3,m4"
        path = out / f"run{number + 1}.csv"
        columns = np.column_stack([log[:, :11], np.round(65535.0 * log[:, 11:15])])
        np.savetxt(path, columns, "%.7g", ",", header=names, comments="")
        paths.append(path)
    return paths


@jitted
def _wanted(figure: Array, t: float) -> tuple[float, float, float, float]:
    """Place and heading that are asked for."""
    growth = min(t / 3.0, 1.0)
    phase = 2.0 * math.pi * t / figure[2] + figure[6]
    x = growth * figure[0] * math.cos(phase)
    y = growth * figure[1] * math.sin(figure[3] * phase)
    return x, y, 1.5 + growth * figure[4] * math.sin(0.7 * phase), figure[5]


@jitted
def _change(p: Array, s: Array, command: Array, wind: Array, kick: Array) -> Array:
    """d/dt of place, velocity, nine numbers of the attitude (rows), body rate and rotor speeds."""
    d = np.zeros(22)
    r, w, n = s[6:15].reshape(3, 3), s[15:18], s[18:22]
    f = p[5] * n * n
    lift = f.sum()
    u = s[3:6] - wind
    size = math.sqrt(u[0] ** 2 + u[1] ** 2 + u[2] ** 2)
    drag = -(p[9] + p[10] * size) * u
    d[0:3] = s[3:6]
    for i in range(3):
        along = r[i, 2] + p[14] * r[i, 0] + p[15] * r[i, 1]
        d[3 + i] = (lift * along + drag[i]) / p[0] + kick[i]
    d[5] -= G
    skew = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    d[6:15] = (r @ skew).ravel()
    lever = p[1] / math.sqrt(2.0)
    m = np.array([
        lever * (f[2] + f[3] - f[0] - f[1]),
        lever * (f[1] + f[2] - f[0] - f[3]),
        p[6] * (f[1] + f[3] - f[0] - f[2]),
    ])  # fmt: skip
    d[15] = (m[0] - (p[4] - p[3]) * w[1] * w[2]) / p[2] + kick[3]
    d[16] = (m[1] - (p[2] - p[4]) * w[2] * w[0]) / p[3] + kick[4]
    d[17] = (m[2] - (p[3] - p[2]) * w[0] * w[1]) / p[4] + kick[5]
    d[18:22] = (command * p[7] - n) / p[8]
    return d


@jitted
def fly(p: Array, figure: Array, noise: Array, log: Array) -> None:
    """One flight; `log` gets time, place, quaternion, rate, duty at each line."""
    s = np.zeros(22)
    heading = figure[5]
    s[0], s[1], s[2], _ = _wanted(figure, 0.0)
    s[6], s[7], s[9], s[10], s[14] = (
        math.cos(heading),
        -math.sin(heading),
        math.sin(heading),
        math.cos(heading),
        1.0,
    )
    s[18:22] = math.sqrt(p[0] * G / 4.0 / p[5])
    command = s[18:22] / p[7]
    total = np.zeros(3)
    air = np.zeros(3)
    kick = np.zeros(6)
    for k in range(noise.shape[0]):
        t = k * STEP
        if k % PER_TICK == 0:
            command = _control(p, figure, s, t, total)
        if k % PER_LINE == 0:
            _write(log[k // PER_LINE], t, s, command)
        air += STEP * (-air / 1.0) + p[13] * math.sqrt(2.0 * STEP) * noise[k, 0:3]
        kick[0:3] += STEP * (-kick[0:3] / 0.2) + 0.05 * math.sqrt(2.0 * STEP / 0.2) * noise[k, 3:6]
        kick[3:5] += STEP * (-kick[3:5] / 0.1) + 0.3 * math.sqrt(2.0 * STEP / 0.1) * noise[k, 6:8]
        wind = np.array([p[11] + air[0], p[12] + air[1], 0.3 * air[2]])
        a = _change(p, s, command, wind, kick)
        b = _change(p, s + 0.5 * STEP * a, command, wind, kick)
        c = _change(p, s + 0.5 * STEP * b, command, wind, kick)
        d = _change(p, s + STEP * c, command, wind, kick)
        s += STEP / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        # Gram and Schmidt: a turn stays a turn.
        r = s[6:15].reshape(3, 3)
        x = r[:, 0] / math.sqrt((r[:, 0] ** 2).sum())
        y = r[:, 1] - (x * r[:, 1]).sum() * x
        y /= math.sqrt((y**2).sum())
        z = np.cross(x, y)
        for i in range(3):
            s[6 + 3 * i], s[7 + 3 * i], s[8 + 3 * i] = x[i], y[i], z[i]


@jitted
def _control(p: Array, figure: Array, s: Array, t: float, total: Array) -> Array:
    """Cascaded loops: place, velocity (with an integral), tilt, rate; duty of the four rotors."""
    x, y, z, heading = _wanted(figure, t)
    goal = np.array([x, y, z])
    error = 1.4 * (goal - s[0:3]) - s[3:6]
    later = _wanted(figure, t + 0.05)
    error += np.array([later[0] - x, later[1] - y, later[2] - z]) / 0.05
    total += STEP * PER_TICK * error
    push = 2.6 * error + 1.0 * total
    r, w = s[6:15].reshape(3, 3), s[15:18]
    c, si = math.cos(heading), math.sin(heading)
    forward, left = c * push[0] + si * push[1], -si * push[0] + c * push[1]
    pitch = min(max(math.atan2(forward, G), -0.7), 0.7)
    roll = min(max(-math.atan2(left, G), -0.7), 0.7)
    now_pitch, now_roll = -math.asin(min(max(r[2, 0], -1.0), 1.0)), math.atan2(r[2, 1], r[2, 2])
    turned = math.atan2(r[1, 0], r[0, 0]) - heading
    rate = np.array([7.0 * (roll - now_roll), 7.0 * (pitch - now_pitch), -2.5 * math.sin(turned)])
    m = np.array([p[2], p[3], p[4]]) * np.array([18.0, 18.0, 6.0]) * (rate - w)
    lift = p[0] * (G + push[2]) / max(r[2, 2], 0.4)
    lever = 4.0 * p[1] / math.sqrt(2.0)
    a, b, e = m[0] / lever, m[1] / lever, m[2] / (4.0 * p[6])
    f = np.array([-a - b - e, -a + b + e, a + b - e, a - b + e]) + 0.25 * lift
    most = p[5] * p[7] ** 2
    return np.sqrt(np.minimum(np.maximum(f, 0.02 * most), most) / p[5]) / p[7]


@jitted
def _write(line: Array, t: float, s: Array, command: Array) -> None:
    r = s[6:15].reshape(3, 3)
    w = 0.5 * math.sqrt(max(1.0 + r[0, 0] + r[1, 1] + r[2, 2], 1e-12))
    line[0] = t
    line[1:4] = s[0:3]
    line[4], line[5], line[6] = (
        (r[2, 1] - r[1, 2]) / (4 * w),
        (r[0, 2] - r[2, 0]) / (4 * w),
        (r[1, 0] - r[0, 1]) / (4 * w),
    )
    line[7] = w
    line[8:11] = s[15:18]
    line[11:15] = command
