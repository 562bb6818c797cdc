"""Paths that a lab flies: laps, eights, Lissajous figures, climbs, steps, shakes and turns, eased in."""

import math

import numpy as np

from tests.truth.airframe import G

Array = np.ndarray
KINDS = ("lap", "eight", "shake", "steps", "lissajous", "climbs")
TAKE_OFF = 2.5
"""s, from rest to hovering height."""


def draw_path(
    rng: np.random.Generator, kind: str, period: float, seconds: float, rest: float, size: float
) -> Array:
    """Goals at each `period` (s): place, velocity, acceleration, heading; shape (m, 10).

    `rest` is how long the vehicle stands on the floor first (s, 0: it starts in the air), `size` the extent
    of a path in units of what a Crazyflie flies in a room.
    """
    t = np.arange(round(seconds / period)) * period
    start = rest + (TAKE_OFF if rest else 0.5)
    u = np.maximum(t - start, 0.0)
    place = np.zeros((len(t), 4))
    fade = _ease(u / 3.0)
    hardest = rng.uniform(3.0, 6.0)  # m/s2, at the bends
    reach = size * rng.uniform(0.5, 1.0)
    omega = min(math.sqrt(hardest / reach), 4.0 / math.sqrt(size))
    phase = omega * np.cumsum(fade) * period
    shift = rng.uniform(0.0, 2.0 * np.pi, 3)
    way = rng.choice((-1.0, 1.0))
    if kind == "lap":
        place[:, 0], place[:, 1] = reach * np.sin(phase), way * reach * (1.0 - np.cos(phase))
    elif kind == "eight":
        place[:, 0], place[:, 1] = reach * np.sin(0.7 * phase), way * 0.5 * reach * np.sin(1.4 * phase)
    elif kind == "lissajous":
        for axis, (share, ratio) in enumerate(((0.9, 0.7), (0.7, 0.53), (0.3, 0.83))):
            place[:, axis] = share * reach * (np.sin(ratio * phase + shift[axis]) - np.sin(shift[axis]))
    elif kind == "shake":
        for axis, (slow, quick) in enumerate(((0.5, 1.6), (0.6, 1.9))):
            hertz = slow * (quick / slow) ** (0.5 - 0.5 * np.cos(2.0 * np.pi * u / 10.0)) / math.sqrt(size)
            turning = 2.0 * np.pi * np.cumsum(hertz * fade) * period + shift[axis]
            place[:, axis] = (
                hardest / (2.0 * np.pi * hertz) ** 2 * fade * (np.sin(turning) - np.sin(shift[axis]))
            )
    elif kind == "climbs":
        place[:, 2] = 0.35 * reach * np.sin(1.2 * phase)
        place[:, 0] = 0.4 * reach * np.sin(0.4 * phase)
    else:
        for axis, step in ((0, 0.4), (1, 0.4), (2, 0.2)):
            place[:, axis] = step * reach * _held(t, start, 0.6 * math.sqrt(size), rng)
    if rng.random() < 0.5:
        place[:, 3] = rng.uniform(0.5, 1.5) * fade * np.sin(rng.uniform(0.3, 0.8) * u)
    height = 1.2 * size
    place[:, 2] += height if not rest else height * _ease((t - rest) / TAKE_OFF)
    goals = np.zeros((len(t), 10))
    goals[:, 0:3], goals[:, 9] = place[:, 0:3], place[:, 3]
    velocity = np.gradient(place[:, 0:3], period, axis=0)
    goals[:, 3:6] = np.clip(velocity, -4.0 * size, 4.0 * size)
    if kind != "steps":
        goals[:, 6:9] = np.clip(np.gradient(velocity, period, axis=0), -0.5 * G, 0.5 * G)
    return goals


def _ease(s: Array) -> Array:
    s = np.clip(s, 0.0, 1.0)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


def _held(t: Array, start: float, quick: float, rng: np.random.Generator) -> Array:
    """Levels between -1 and 1, each held for 1 to 2.5 s and reached within `quick` (s)."""
    out, at, level = np.zeros(len(t)), start + 1.0, 0.0
    while at < t[-1]:
        following = rng.uniform(-1.0, 1.0)
        out += (following - level) * _ease((t - at) / quick)
        level, at = following, at + rng.uniform(1.0, 2.5)
    return out
