"""Set-points of the flights: rest on the floor, take-off, a manoeuvre with a name, landing, rest."""

from collections.abc import Callable

import numpy as np

from tests.truth.hidden_effects.layout import CEILING, CONTROL_PERIOD, Setpoint

DURATION = 35.0
ON, ALOFT, HOME, DOWN, OFF = 2.5, 5.0, 29.5, 31.0, 34.2
"""s: motors on; the manoeuvre begins; it ends; the descent begins; motors off."""
CRUISE = 1.1
DESCENT = 0.4

Array = np.ndarray


def setpoints(shape: str, rng: np.random.Generator, floor_z: float) -> Array:
    """Set-point rows (ticks, columns of `Setpoint`) of a flight that starts at rest at `floor_z` (m)."""
    ticks = round(DURATION / CONTROL_PERIOD)
    t = np.arange(ticks) * CONTROL_PERIOD
    rows = np.zeros((ticks, len(Setpoint)))
    rows[:, Setpoint.COLLECTIVE] = -1.0
    rows[:, Setpoint.ARMED] = (t >= ON) & (t < OFF)
    height = _ease((t - ON) / 1.8) * (CRUISE - floor_z) + floor_z
    descent = np.maximum(CRUISE - DESCENT * (t - DOWN), -0.1)
    rows[:, Setpoint.Z] = np.where(t < DOWN, height, descent)
    inside = (t >= ALOFT) & (t < HOME)
    SHAPES[shape](t[inside] - ALOFT, rows[inside_slice(inside)], rng)
    # Velocity and acceleration are fed forward on smooth paths; steps stay steps.
    smooth = (0, 1, 2) if shape.startswith(_SMOOTH) else () if shape in _STEPS_UP else (2,)
    for column in smooth:
        velocity = np.gradient(rows[:, column], t)
        rows[:, column + 3] = velocity
        rows[:, column + 6] = np.clip(np.gradient(velocity, t), -4.0, 4.0)
    return rows


def inside_slice(inside: Array) -> slice:
    """The run of True as a slice, so that a view is written to."""
    places = np.flatnonzero(inside)
    return slice(int(places[0]), int(places[-1]) + 1)


_SMOOTH = ("circle", "figure8", "helix", "lissajous", "under", "over")
_STEPS_UP = ("vertical_steps",)


def _ease(s: Array) -> Array:
    s = np.clip(s, 0.0, 1.0)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


def _fade(s: Array) -> Array:
    """1 in the middle of a manoeuvre, 0 at its ends, smooth."""
    return _ease(s / 3.0) * _ease((s[-1] - s) / 3.0)


def _phase(s: Array, hertz: float) -> Array:
    """Phase (rad) of an oscillation that starts and stops softly."""
    return np.cumsum(2 * np.pi * hertz * _fade(s)) * CONTROL_PERIOD


def _circle(radius: float, hertz: float, clockwise: bool = False) -> Callable[..., None]:
    def write(s: Array, rows: Array, rng: np.random.Generator) -> None:
        # Half the time one way round and half the other way.
        half = s.size // 2
        for part, sign in ((slice(0, half), 1.0), (slice(half, None), -1.0)):
            u = s[part] - s[part][0]
            angle = (-sign if clockwise else sign) * _phase(u, hertz)
            grown = radius * _fade(u)
            rows[part, Setpoint.X] = grown * np.cos(angle)
            rows[part, Setpoint.Y] = grown * np.sin(angle)

    return write


def _figure8(size: float, hertz: float) -> Callable[..., None]:
    def write(s: Array, rows: Array, rng: np.random.Generator) -> None:
        angle = _phase(s, hertz)
        rows[:, Setpoint.X] = size * _fade(s) * np.sin(angle)
        rows[:, Setpoint.Y] = 0.5 * size * _fade(s) * np.sin(2 * angle)

    return write


def _helix(radius: float, hertz: float) -> Callable[..., None]:
    def write(s: Array, rows: Array, rng: np.random.Generator) -> None:
        _circle(radius, hertz)(s, rows, rng)
        rows[:, Setpoint.Z] += 0.5 * _fade(s) * np.sin(_phase(s, 0.12))
        rows[:, Setpoint.YAW] = 0.8 * _fade(s) * np.sin(_phase(s, 0.07))

    return write


def _lissajous(s: Array, rows: Array, rng: np.random.Generator) -> None:
    shift = rng.uniform(0.0, 2 * np.pi, 3)
    for column, size, hertz, start in zip(
        (0, 1, 2), (0.8, 0.6, 0.35), (0.31, 0.23, 0.37), shift, strict=True
    ):
        rows[:, column] += size * _fade(s) * np.sin(_phase(s, hertz) + start)
    rows[:, Setpoint.YAW] = 1.0 * _fade(s) * np.sin(_phase(s, 0.11))


def _held(s: Array, rng: np.random.Generator, values: Array, shortest: float, longest: float) -> Array:
    """Random values, each held for a random time (s)."""
    out, at = np.zeros_like(s), 0.0
    last = np.nan
    while at < s[-1]:
        value = rng.choice(values[values != last])
        out[s >= at] = value
        last, at = value, at + rng.uniform(shortest, longest)
    out[s > s[-1] - 1.5] = 0.0
    return out


def _vertical_steps(s: Array, rows: Array, rng: np.random.Generator) -> None:
    rows[:, Setpoint.Z] += _held(s, rng, np.array([-0.5, -0.25, 0.0, 0.3, 0.55]), 1.0, 2.0)


def _doublets(column: Setpoint, size: float) -> Callable[..., None]:
    def write(s: Array, rows: Array, rng: np.random.Generator) -> None:
        rows[:, column] += _held(s, rng, size * np.array([-1.0, -0.5, 0.0, 0.5, 1.0]), 0.5, 1.4)

    return write


def _sweep(s: Array, rng: np.random.Generator, slow: float, quick: float, size: float) -> Array:
    """Repeated exponential chirp (6 s), Hz."""
    u = np.mod(s, 6.0) / 6.0
    hertz = slow * (quick / slow) ** u
    return size * _fade(s) * np.sin(2 * np.pi * np.cumsum(hertz) * CONTROL_PERIOD + rng.uniform(0, 2 * np.pi))


def _attitude_chirp(s: Array, rows: Array, rng: np.random.Generator) -> None:
    rows[:, Setpoint.ROLL] = _sweep(s, rng, 0.6, 3.0, np.deg2rad(9.0))
    rows[:, Setpoint.PITCH] = _sweep(s + 3.0, rng, 0.6, 3.0, np.deg2rad(9.0))


def _rate_chirp(s: Array, rows: Array, rng: np.random.Generator) -> None:
    rows[:, Setpoint.P] = _sweep(s, rng, 1.0, 8.0, 1.0)
    rows[:, Setpoint.Q] = _sweep(s + 2.0, rng, 1.0, 8.0, 1.0)
    rows[:, Setpoint.R] = _sweep(s + 4.0, rng, 0.5, 4.0, 1.2)


def _near_ceiling(s: Array, rows: Array, rng: np.random.Generator) -> None:
    """Hovers with the rotors (14 mm above the body's origin) 0.05 to 0.6 m below the ceiling."""
    gaps = np.array([0.6, 0.3, 0.15, 0.1, 0.07, 0.05])
    _stairs(s, rows, CEILING - CRUISE - 0.014 - gaps)


def _near_floor(s: Array, rows: Array, rng: np.random.Generator) -> None:
    """Hovers 0.04 to 0.5 m above the floor."""
    _stairs(s, rows, rng.permutation(np.array([0.04, 0.05, 0.07, 0.1, 0.2, 0.5])) - CRUISE)


def _under_ceiling(s: Array, rows: Array, rng: np.random.Generator) -> None:
    """Slow circles with the rotors 0.3 to 0.08 m below the ceiling."""
    _stairs(s, rows, CEILING - CRUISE - 0.014 - np.array([0.3, 0.15, 0.08]))
    _circle(0.5, 0.12)(s, rows, rng)


def _over_floor(s: Array, rows: Array, rng: np.random.Generator) -> None:
    """Slow circles 0.3 to 0.05 m above the floor."""
    _stairs(s, rows, np.array([0.3, 0.1, 0.05]) - CRUISE)
    _circle(0.5, 0.12)(s, rows, rng)


def _stairs(s: Array, rows: Array, levels: Array) -> None:
    each = (s[-1] - 2.0) / levels.size
    z = np.zeros_like(s)
    last = 0.0
    for k, level in enumerate([*levels, 0.0]):
        z += (level - last) * _ease((s - k * each) / 2.2)
        last = level
    rows[:, Setpoint.Z] += z


def _hover(s: Array, rows: Array, rng: np.random.Generator) -> None:
    rows[:, Setpoint.YAW] = np.pi * _ease((s - 8.0) / 6.0) - np.pi * _ease((s - 16.0) / 6.0)


def _chops(s: Array, rows: Array, rng: np.random.Generator) -> None:
    """Collective cut for a moment, from high enough to catch the fall, with pushes between."""
    rows[:, Setpoint.Z] += 0.45 * _ease(s / 2.0) * _ease((s[-1] - s) / 2.0)
    at = 2.5
    while at < s[-1] - 3.0:
        depth, span = rng.uniform(0.2, 0.6), rng.uniform(0.12, 0.2)
        rows[(s >= at) & (s < at + span), Setpoint.COLLECTIVE] = depth
        at += rng.uniform(1.8, 2.6)


SHAPES: dict[str, Callable[[Array, Array, np.random.Generator], None]] = {
    "circle_slow": _circle(0.7, 0.13),
    "circle_medium": _circle(0.7, 0.22, clockwise=True),
    "circle_fast": _circle(0.75, 0.32),
    "figure8_slow": _figure8(0.8, 0.14),
    "figure8_fast": _figure8(0.9, 0.23),
    "helix": _helix(0.6, 0.25),
    "lissajous": _lissajous,
    "vertical_steps": _vertical_steps,
    "doublet_x": _doublets(Setpoint.X, 0.45),
    "doublet_y": _doublets(Setpoint.Y, 0.45),
    "doublet_yaw": _doublets(Setpoint.YAW, 0.9),
    "attitude_chirp": _attitude_chirp,
    "rate_chirp": _rate_chirp,
    "near_ceiling": _near_ceiling,
    "near_floor": _near_floor,
    "under_ceiling": _under_ceiling,
    "over_floor": _over_floor,
    "hover": _hover,
    "chops": _chops,
}

CAMPAIGN = (
    "circle_fast",
    "vertical_steps",
    "doublet_x",
    "attitude_chirp",
    "figure8_fast",
    "near_ceiling",
    "near_floor",
    "doublet_y",
    "lissajous",
    "chops",
    "hover",
    "rate_chirp",
    "circle_slow",
    "helix",
    "under_ceiling",
    "over_floor",
    "doublet_yaw",
    "vertical_steps",
    "figure8_slow",
    "chops",
)
"""Shapes of the default campaign of 20 flights, in order; a longer one starts again. Floor and ceiling are in
two shapes each, so that one of them can be held out."""
AGILE = ("circle_fast", "vertical_steps", "figure8_fast", "rate_chirp")
"""Shapes whose thrusts a saturation is measured against."""


def campaign(flights: int) -> list[tuple[str, str]]:
    """Name (``<shape>_rep<k>``) and shape of each flight."""
    seen: dict[str, int] = {}
    out = []
    for k in range(flights):
        shape = CAMPAIGN[k % len(CAMPAIGN)]
        seen[shape] = seen.get(shape, 0) + 1
        out.append((f"{shape}_rep{seen[shape]}", shape))
    return out
