"""Flights of a controlled vehicle that disturbances push about, and the residual that a perfect model leaves.

Path and controller are those of point mass and rigid body about the hover, linear, so that forty sets of
flights take seconds. What matters is kept: the noise figures of real flights (their colour, and that sensor
noise enters record and residual alike) and that the motion answers to the disturbances.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete, lfilter
from scipy.spatial.transform import Rotation

from calibration.gap.data import differentiate
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import Signals

DT = 0.01
SECONDS = 20.0
SHAPES = ("hover", "circle", "figure8", "lissajous", "steps", "hover_turning", "fast_circle", "vertical")

Array = np.ndarray


@dataclass
class Flights:
    """Records, the signals' grid, and the residual of a perfect model, shape (n, 7)."""

    records: list[FlightRecord]
    signals: Signals
    residual: Array

    def add(self, column: Array) -> Array:
        """The residual with something in it, shape (n, 7): nothing where it is not valid, no part means."""
        left = np.where(self.signals.valid, self.residual + column, 0.0)
        for part in range(self.signals.part_bounds.size - 1):
            rows = slice(self.signals.part_bounds[part], self.signals.part_bounds[part + 1])
            count = np.maximum(self.signals.valid[rows].sum(axis=0), 1)
            left[rows] -= np.where(self.signals.valid[rows], left[rows].sum(axis=0) / count, 0.0)
        return left

    def along(self, name: str) -> Array:
        """A quantity of the records, one below the other."""
        return np.concatenate([getattr(record, name) for record in self.records])

    def world_force(self, axis: int, shape: Array) -> Array:
        """Signals of a force (m/s2) along an axis of the world."""
        column = np.zeros_like(self.residual)
        turns = Rotation.from_quat(self.along("attitude")).as_matrix()
        for i in range(3):
            column[:, i] = turns[:, axis, i] * shape
        return column

    def times(self) -> Array:
        """s since the beginning of each flight."""
        return np.concatenate([record.t for record in self.records])


def disturbed_flights(
    seed: int, shapes: tuple[str, ...] = SHAPES, slow_torque: float = 0.0, seconds: float = SECONDS
) -> Flights:
    """Flights with nothing in them but noise.

    Args:
        seed: of all noise.
        shapes: one flight each.
        slow_torque: rad/s2, of a torque with a memory of 2 s.
        seconds: length of each.
    """
    rng = np.random.default_rng(seed)
    made = [_flight(shape, f"{shape}_{k}", rng, slow_torque, seconds) for k, shape in enumerate(shapes)]
    count = made[0][0].t.size
    valid = np.ones((count, 7), dtype=bool)
    valid[: round(0.5 / DT)] = False
    valid[-1, 3:6] = False
    valid = np.tile(valid, (len(made), 1))
    bounds = count * np.arange(len(made) + 1)
    residual = np.vstack([residual for _, residual in made])
    flights = Flights([r for r, _ in made], Signals(np.zeros_like(residual), valid, bounds, DT), residual)
    flights.residual = flights.add(np.zeros_like(residual))
    return flights


def coloured(rng: np.random.Generator, count: int, size: float, memory: float) -> Array:
    """Three Ornstein-Uhlenbeck processes, shape (count, 3)."""
    keep = np.exp(-DT / memory)
    white = size * np.sqrt(1.0 - keep * keep) * rng.standard_normal((count, 3))
    white[0] /= np.sqrt(1.0 - keep * keep)
    return lfilter([1.0], [1.0, -keep], white, axis=0)


def _answer(push: Array, stiffness: float, damping: float) -> tuple[Array, Array]:
    """Deviation, and its rate, of a mass on a spring with a damper that is pushed."""
    found = []
    for numerator in ([1.0], [1.0, 0.0]):
        num, den, _ = cont2discrete((numerator, [1.0, damping, stiffness]), DT)
        found.append(lfilter(num.ravel(), den, push, axis=0))
    return found[0], found[1]


def _path(shape: str, t: Array, rng: np.random.Generator) -> Array:
    """Commanded position, shape (n, 3)."""
    fade = np.clip(t / 3.0, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(t / 3.0, 0.0, 1.0))
    zero, turn = np.zeros_like(t), 2.0 * np.pi * t
    start = rng.uniform(0.0, 2.0 * np.pi)
    wave = np.sin(turn * 0.25 + start)
    steps = np.repeat(rng.uniform(-0.6, 0.6, 40), 150)[: t.size]
    smooth = lfilter([0.03], [1.0, -0.97], lfilter([0.03], [1.0, -0.97], steps))
    x, y, z = {
        "hover": (zero, zero, zero),
        "hover_turning": (zero, zero, zero),
        "circle": (0.7 * np.cos(0.2 * turn), 0.7 * np.sin(0.2 * turn), zero),
        "fast_circle": (0.7 * np.cos(-0.35 * turn), 0.7 * np.sin(-0.35 * turn), zero),
        "figure8": (0.9 * np.sin(0.17 * turn), 0.45 * np.sin(0.34 * turn), zero),
        "lissajous": (0.8 * np.sin(0.31 * turn + start), 0.6 * np.sin(0.23 * turn), 0.3 * wave),
        "steps": (smooth, -0.5 * smooth, zero),
        "vertical": (zero, zero, smooth),
    }[shape]
    return np.column_stack([fade * x, fade * y, 1.0 + fade * z])


def _flight(
    shape: str, name: str, rng: np.random.Generator, slow_torque: float, seconds: float
) -> tuple[FlightRecord, Array]:
    t = DT * np.arange(round(seconds / DT))
    force = coloured(rng, t.size, 0.06, 0.4)
    torque = coloured(rng, t.size, 1.0, 0.06) * [2.2, 2.2, 0.7]
    torque += coloured(rng, t.size, slow_torque, 2.0)
    gyro_noise = 0.01 * rng.standard_normal((t.size, 3))
    path = _path(shape, t, rng)
    away, drift = _answer(force, 5.0, 3.6)
    leaning, swing = _answer(torque, 250.0, 25.0)
    position = path + away
    wanted = np.gradient(np.gradient(path, DT, axis=0), DT, axis=0)
    yaw = 0.8 * np.sin(0.5 * t) if "turning" in shape else 0.2 * np.sin(0.3 * t + rng.uniform(0.0, 6.0))
    angles = np.column_stack([-wanted[:, 1] / 9.81, wanted[:, 0] / 9.81, yaw])
    attitude = Rotation.from_euler("xyz", angles + leaning)
    rate = np.gradient(angles, DT, axis=0) + swing + gyro_noise
    voltage = 3.9 - 0.0025 * t - rng.uniform(0.0, 0.3)
    # What a controller knows: the deviations so far, and the gyro with its noise.
    lift = wanted[:, 2:] - 5.0 * away[:, 2:] - 3.6 * drift[:, 2:]
    moment = 250.0 * leaning[:, :2] + 25.0 * (swing + gyro_noise)[:, :2]
    spread = 5e-4 * moment @ [[1.0, 1.0, -1.0, -1.0], [1.0, -1.0, -1.0, 1.0]]
    duty = (0.6 * (1.0 + 0.05 * lift) - spread) * 3.8 / voltage[:, None]
    residual = np.zeros((t.size, 7))
    residual[:, :3] = attitude.inv().apply(force) + 0.05 * rng.standard_normal((t.size, 3))
    residual[:-1, 3:6] = 0.5 * (torque[1:] + torque[:-1]) + np.diff(gyro_noise, axis=0) / DT
    residual[:, 6] = 0.005 * rng.standard_normal(t.size)
    seen = position + 2e-4 * rng.standard_normal((t.size, 3))
    everywhere = np.ones(t.size, dtype=bool)
    record = FlightRecord(
        name=name,
        source=Path(name),
        shape=shape,
        t=t,
        position=seen,
        velocity=differentiate(seen, DT),
        attitude=attitude.as_quat(),
        rate=rate,
        specific_force=residual[:, :3],
        duty=duty,
        voltage=voltage + residual[:, 6],
        flying=everywhere & (t > 0.5),
        motors_known=everywhere,
        pose_known=everywhere,
        inertial_known=everywhere,
        resting=~everywhere,
    )
    return record, residual
