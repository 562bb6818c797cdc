"""Recordings as they arrive when something is broken."""

from dataclasses import replace

import numpy as np

from calibration.bench.inertia.swing import CLOCK_WRAP_S, Swing


def damaged(swing: Swing, rng: np.random.Generator) -> Swing:
    """`swing` with one to three random kinds of damage."""
    for kind in rng.choice(len(_KINDS), size=rng.integers(1, 4), replace=False):
        swing = _KINDS[kind](swing, rng)
    return swing


def _chosen(swing: Swing, rows: np.ndarray) -> Swing:
    acceleration = None if swing.acceleration is None else swing.acceleration[rows]
    return replace(swing, time=swing.time[rows], gyro=swing.gyro[rows], acceleration=acceleration)


def _truncate(swing: Swing, rng: np.random.Generator) -> Swing:
    return _chosen(swing, np.arange(rng.integers(0, len(swing) + 1)))


def _thin(swing: Swing, rng: np.random.Generator) -> Swing:
    return _chosen(swing, np.flatnonzero(rng.random(len(swing)) < rng.uniform(0.0, 0.6)))


def _hole(swing: Swing, rng: np.random.Generator) -> Swing:
    first, last = np.sort(rng.integers(0, len(swing) + 1, 2))
    return _chosen(swing, np.concatenate([np.arange(first), np.arange(last, len(swing))]))


def _shuffle(swing: Swing, rng: np.random.Generator) -> Swing:
    return _chosen(swing, rng.permutation(len(swing)))


def _repeat_times(swing: Swing, rng: np.random.Generator) -> Swing:
    return replace(swing, time=np.round(swing.time, int(rng.integers(0, 3))))


def _wrap(swing: Swing, rng: np.random.Generator) -> Swing:
    if not len(swing):
        return swing
    return replace(swing, time=np.mod(swing.time + CLOCK_WRAP_S - rng.uniform(0.0, 30.0), CLOCK_WRAP_S))


def _freeze(swing: Swing, rng: np.random.Generator) -> Swing:
    gyro = swing.gyro.copy()
    gyro[rng.integers(0, len(gyro) + 1) :] = gyro[0] if len(gyro) else 0.0
    return replace(swing, gyro=gyro)


def _clip(swing: Swing, rng: np.random.Generator) -> Swing:
    limit = rng.uniform(0.0, 0.8) * np.max(np.abs(swing.gyro), initial=0.0)
    return replace(swing, gyro=np.clip(swing.gyro, -limit, limit))


def _spikes(swing: Swing, rng: np.random.Generator) -> Swing:
    gyro = swing.gyro + 35.0 * (rng.random(swing.gyro.shape) < 0.01)
    return replace(swing, gyro=gyro)


def _noise(swing: Swing, rng: np.random.Generator) -> Swing:
    return replace(swing, gyro=swing.gyro + rng.normal(0.0, 10.0 ** rng.uniform(-3, 2), swing.gyro.shape))


def _dead(swing: Swing, rng: np.random.Generator) -> Swing:
    return replace(swing, gyro=swing.gyro * (rng.random(3) < 0.3))


def _scale(swing: Swing, rng: np.random.Generator) -> Swing:
    return replace(swing, gyro=swing.gyro * 10.0 ** rng.uniform(-300, 3))


def _stretch(swing: Swing, rng: np.random.Generator) -> Swing:
    return replace(swing, time=swing.time * 10.0 ** rng.uniform(-6, 4))


_KINDS = (
    *(_truncate, _thin, _hole, _shuffle, _repeat_times, _wrap),
    *(_freeze, _clip, _spikes, _noise, _dead, _scale, _stretch),
)
