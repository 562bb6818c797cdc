"""A rotor with a tachometer, integrated numerically: shares no formula with the fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.bench.motors.records import CommandRecord, EdgeRecord, WindowRecord

TICK = 4e-6


@dataclass(frozen=True)
class Motor:
    """dw/dt = a (ws - w) + b (ws^2 - w^2), (a, b) by the direction of the command, plus dry friction."""

    a_up: float = 2.0
    b_up: float = 4.2e-3
    a_down: float = 0.5
    b_down: float = 1.8e-3
    friction: float = 0.0

    def acceleration(self, w: float, ws: float) -> float:
        rising = ws > w
        a, b = (self.a_up, self.b_up) if rising else (self.a_down, self.b_down)
        return a * (ws - w) + b * (ws * ws - w * w) - (self.friction if w > 0.0 and not rising else 0.0)


@dataclass(frozen=True)
class Sensor:
    marks: int = 2
    unevenness: float = 0.02  # of an interval, from mark to mark
    jitter: float = 3e-6
    missed: float = 0.0
    doubled: float = 0.0


@dataclass(frozen=True)
class Run:
    """True motion of a staircase: times (s), speed (rad/s) and angle (rad) on a fine grid."""

    t: np.ndarray
    w: np.ndarray
    angle: np.ndarray
    commands: CommandRecord


def turn(motor: Motor, levels: Sequence[float], hold: float = 1.6, w0: float = 0.0, dt: float = 5e-4) -> Run:
    """Hold each settled speed of `levels` for `hold` s."""
    w, angle = [w0], [0.0]
    per_level = round(hold / dt)
    f = motor.acceleration
    x, q = w0, 0.0
    for ws in levels:
        for _ in range(per_level):
            k1 = f(x, ws)
            k2 = f(x + 0.5 * dt * k1, ws)
            k3 = f(x + 0.5 * dt * k2, ws)
            k4 = f(x + dt * k3, ws)
            new = max(x + dt * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0, 0.0)
            q += dt * 0.5 * (x + new) - dt * dt * (f(new, ws) - k1) / 12.0 if new > 0.0 else 0.0
            x = new
            w.append(x)
            angle.append(q)
    t = dt * np.arange(len(w))
    commands = CommandRecord(
        hold * np.arange(len(levels)), np.clip(np.rint(np.array(levels) * 20.0), 0, 65535)
    )
    return Run(t, np.array(w), np.array(angle), commands)


def edges(run: Run, sensor: Sensor, rng: np.random.Generator, clock: float = 1.0) -> EdgeRecord:
    """What the sensor sees; `clock` is the instrument's second over the true one."""
    total = int(run.angle[-1] / (2.0 * np.pi) * sensor.marks)
    number = np.arange(1, total)
    pattern = np.array([0.5, -0.5, 0.1, -0.2])[: sensor.marks]
    place = (number + sensor.unevenness * pattern[number % sensor.marks] * 0.5) * 2.0 * np.pi / sensor.marks
    moving = np.concatenate([[True], np.diff(run.angle) > 0.0])
    times = np.interp(place, run.angle[moving], run.t[moving])
    times = times + rng.normal(0.0, sensor.jitter, times.size)
    kept = times[rng.random(times.size) >= sensor.missed]
    twice = np.flatnonzero(rng.random(kept.size) < sensor.doubled)
    gaps = np.diff(kept, append=kept[-1] + 1e-3)
    echo = kept[twice] + np.minimum(rng.uniform(200e-6, 400e-6, twice.size), 0.4 * gaps[twice])
    seen = np.sort(np.concatenate([kept, echo])) * clock
    seen = np.unique(np.rint(seen / TICK)) * TICK
    return EdgeRecord(seen, np.arange(1, seen.size + 1), "simulated")


def windows(run: Run, window: float, rng: np.random.Generator, marks: int = 2) -> WindowRecord:
    """The authors' instrument: marks counted in windows."""
    ends = np.arange(rng.uniform(0.0, window), run.t[-1], window)
    counts = np.floor(np.interp(ends, run.t, run.angle) * marks / (2.0 * np.pi) + rng.uniform())
    speeds = np.diff(counts, prepend=counts[0]) * 2.0 * np.pi / (marks * window)
    return WindowRecord(ends, speeds, marks, "windows")


def staircase(
    rng: np.random.Generator, mid: float = 1500.0, high: float = 2400.0, repeats: int = 3
) -> list[float]:
    """Levels of a run: three kinds of step up and three down, in random order, each `repeats` times."""
    levels = [0.0]
    for _ in range(repeats):
        tour = [
            [mid, high, mid, 0.0, high, 0.0],
            [high, mid, high, 0.0, mid, 0.0],
            [mid, 0.0, high, mid, high, 0.0],
        ]
        levels += tour[rng.integers(3)]
    return levels
