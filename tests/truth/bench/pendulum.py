"""A bifilar pendulum for the tests: its equation of motion, integrated, and a gyro that looks at it.

It shares no formula with the fit: the strings are rigid and of finite length, so the body rises as it turns,
``(I + m z'^2) a'' + m z' z'' a'^2 = -m g z' - I (2 c a' + d |a'| a')`` with
``z = -sqrt(L^2 - rt^2 - rb^2 + 2 rt rb cos a)``; a centre of mass off the middle by e takes e^2 from rt rb.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from calibration.bench.inertia.swing import Swing
from onboard.arrays import FloatArray

QUANTUM = math.radians(0.061)


@dataclass(frozen=True)
class Hang:
    """One drone on two strings, SI; `swing` is the share of the start rate that a pendulum mode adds."""

    inertia: float = 30e-6
    mass: float = 0.034
    top: float = 0.06
    bottom: float = 0.06
    length: float = 0.6
    gravity: float = 9.803
    offset: float = 0.0
    linear: float = 0.008
    quadratic: float = 0.01
    swing: float = 0.0

    @property
    def product(self) -> float:
        return 0.25 * self.top * self.bottom - self.offset**2

    @property
    def drop(self) -> float:
        return math.sqrt(self.length**2 - 0.25 * (self.top - self.bottom) ** 2)

    @property
    def period(self) -> float:
        """Of infinitely small swings (the linearised equation of motion)."""
        return math.tau * math.sqrt(self.inertia * self.drop / (self.mass * self.gravity * self.product))

    def changed(self, **fields: float) -> "Hang":
        return replace(self, **fields)


@njit(cache=True)
def _turn(angle, rate, inertia, mass, product, square, gravity, linear, quadratic):  # type: ignore[no-untyped-def]
    h = math.sqrt(square + 2.0 * product * math.cos(angle))
    z1 = product * math.sin(angle) / h
    z2 = product * math.cos(angle) / h + z1 * z1 / h
    torque = -mass * gravity * z1 - inertia * (2.0 * linear * rate + quadratic * abs(rate) * rate)
    return (torque - mass * z1 * z2 * rate * rate) / (inertia + mass * z1 * z1)


@njit(cache=True)
def _integrate(angle, steps, dt, p):  # type: ignore[no-untyped-def]
    inertia, mass, product, square, gravity, linear, quadratic = p
    rates = np.empty(steps + 1)
    rate = 0.0
    rates[0] = 0.0
    for k in range(steps):
        a1 = _turn(angle, rate, inertia, mass, product, square, gravity, linear, quadratic)
        v2, x2 = rate + 0.5 * dt * a1, angle + 0.5 * dt * rate
        a2 = _turn(x2, v2, inertia, mass, product, square, gravity, linear, quadratic)
        v3, x3 = rate + 0.5 * dt * a2, angle + 0.5 * dt * v2
        a3 = _turn(x3, v3, inertia, mass, product, square, gravity, linear, quadratic)
        v4, x4 = rate + dt * a3, angle + dt * v3
        a4 = _turn(x4, v4, inertia, mass, product, square, gravity, linear, quadratic)
        angle += dt / 6.0 * (rate + 2.0 * v2 + 2.0 * v3 + v4)
        rate += dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        rates[k + 1] = rate
    return rates


def true_rate(hang: Hang, degrees: float, time: FloatArray) -> FloatArray:
    """Turn rate at `time` after a release at rest from `degrees`: RK4, 400 steps a period."""
    dt = hang.period / 400.0
    steps = math.ceil(float(time[-1]) / dt) + 2
    square = hang.drop**2 - 2.0 * hang.product
    p = (hang.inertia, hang.mass, hang.product, square, hang.gravity, hang.linear, hang.quadratic)
    rates = _integrate(math.radians(degrees), steps, dt, p)
    return np.asarray(CubicSpline(np.arange(steps + 1) * dt, rates)(time))


def record(
    hang: Hang,
    rng: np.random.Generator,
    degrees: float = 10.0,
    cycles: float = 20.0,
    rate_hz: float = 100.0,
    jitter: float = 0.0,
    loss: float = 0.0,
    gap: float = 0.0,
    noise: float = 2.5e-3,
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0),
    bias: tuple[float, float, float] = (0.01, -0.02, 0.005),
) -> Swing:
    """What the gyro logs: 1 ms stamps (with `jitter` s of host), lost samples, one gap, noise, quantum."""
    time = np.arange(0.0, cycles * hang.period, 1.0 / rate_hz) + rng.uniform(0.0, 1.0 / rate_hz)
    rate = true_rate(hang, degrees, time)
    if hang.swing:
        fade = np.exp(-rng.uniform(0.5, 1.5) * hang.linear * time)
        peak = np.max(np.abs(rate[: max(2, int(rate_hz * hang.period))]))
        frequency = math.sqrt(hang.gravity / hang.length)
        rate = rate + hang.swing * peak * fade * np.cos(frequency * time + rng.uniform(0.0, math.tau))
    direction = np.array(axis) / math.hypot(*axis)
    gyro = rate[:, None] * direction + np.array(bias) + noise * rng.standard_normal((len(time), 3))
    gyro = np.round(gyro / QUANTUM) * QUANTUM
    kept = rng.random(len(time)) >= loss
    if gap:
        begin = rng.uniform(0.1, 0.9) * time[-1]
        kept &= (time < begin) | (time > begin + gap)
    stamps = np.round(time + (rng.normal(0.0, jitter, len(time)) if jitter else 0.0), 3) + 12.345
    stamps = np.sort(stamps[kept])  # packets arrive in their order, at most three in a millisecond
    stamps += 2e-4 * np.arange(len(stamps)) % 6e-4 if jitter else 0.0
    acceleration = np.tile(hang.gravity * direction, (len(stamps), 1))
    acceleration += 0.02 * rng.standard_normal(acceleration.shape)
    clock = "host" if jitter else "drone"
    return Swing(stamps, gyro[kept], "simulated", acceleration, clock, axis)
