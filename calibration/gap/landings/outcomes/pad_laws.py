"""Laws of what a foot needs to stick, one at a time, each with a limit that differs from landing to landing.

A foot sticks where it touches fast enough (``pads``), once it is pushed hard enough (``preload``), once it
was pushed for long enough (``impulse``), or while its rod is upright enough (``angle``); the equations and
their sources are those of the effects. Which limits are worth a try follows from the vehicle: a foot that
meets the ceiling at v with a quarter of the mass m behind it takes the impulse m v / 4 and, on an undamped
rod of stiffness k, pushes with up to v sqrt(k m / 4) (half a period of a sine). A foot whose rod leans hands
on a part of both only, for its hinge gives way.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import norm

from onboard.arrays import FloatArray


class PadLaw(NamedTuple):
    """A law on the grid of vehicles.

    Attributes:
        limit, spread: names of its coordinates, mean and standard deviation over landings.
        limits: rising, at which landings are simulated.
        means, spreads: of the vehicles that are tried.
    """

    limit: str
    spread: str
    limits: tuple[float, ...]
    means: tuple[float, ...]
    spreads: tuple[float, ...]


LIMITS = (0.0, 0.15, 0.3, 0.45, 0.6, 0.75, 0.9, 1.05, 1.2, 1.5, 2.0, 2.5, 3.0)
"""m/s: least speed of a foot that sticks, at which landings are simulated."""

SPEEDS = (*(round(0.1 * count, 1) for count in range(1, 16)), 1.75, 2.0, 2.5)
"""m/s: means of the limit."""

SPREADS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
"""m/s: standard deviations of the limit from landing to landing."""

_PUSHES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8)
_PUSH_MEANS = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8)
_PUSH_SPREADS = (0.05, 0.1, 0.2, 0.3)
"""m/s: speeds whose push is such a limit."""

_IMPULSES = (0.0, 0.2, 0.4, 0.8, 1.2, 1.8, 2.5, 3.5)
_IMPULSE_MEANS = (0.2, 0.4, 0.6, 0.8, 1.2, 1.6, 2.0, 2.5, 3.0, 3.5)
_IMPULSE_SPREADS = (0.2, 0.4, 0.8, 1.2)
"""m/s: speeds whose impulse is such a limit; a foot may also just press for long."""

ANGLES_DEG = (20.0, 32.0, 42.0, 50.0, 58.0, 68.0, 90.0)
"""Limits of the angle; no rod leans by more than the last."""

MEAN_ANGLES_DEG = tuple(np.arange(20.0, 76.0, 5.0).tolist())
ANGLE_SPREADS_DEG = (3.0, 6.0, 12.0, 20.0)


def pad_laws(parameters: Any) -> dict[str, PadLaw]:
    """All laws by name, for a vehicle's record of physics parameters."""
    behind = 0.25 * float(parameters["mass"])
    impulse, push = behind, math.sqrt(float(parameters["axial_stiffness"]) * behind)
    return {
        "pads": PadLaw("speed", "spread", LIMITS, SPEEDS, SPREADS),
        "preload": _scaled("preload", push, (_PUSHES, _PUSH_MEANS, _PUSH_SPREADS)),
        "impulse": _scaled("impulse", impulse, (_IMPULSES, _IMPULSE_MEANS, _IMPULSE_SPREADS)),
        "angle": PadLaw(
            "angle",
            "angle_spread",
            tuple(math.radians(angle) for angle in ANGLES_DEG),
            tuple(math.radians(angle) for angle in MEAN_ANGLES_DEG),
            tuple(math.radians(angle) for angle in ANGLE_SPREADS_DEG),
        ),
    }


def _scaled(name: str, per_speed: float, speeds: tuple[tuple[float, ...], ...]) -> PadLaw:
    limits, means, spreads = (tuple(per_speed * v for v in row) for row in speeds)
    return PadLaw(name, f"{name}_spread", limits, means, spreads)


def mixture(limits: tuple[float, ...], mean: float, spread: float) -> FloatArray:
    """Shares of rising limits in a normal distribution of limits; each stands for its surroundings."""
    rungs = np.array(limits)
    if spread <= 0.0:
        return np.array([np.interp(mean, rungs, row) for row in np.eye(rungs.size)])
    edges = np.concatenate([[-np.inf], 0.5 * (rungs[1:] + rungs[:-1]), [np.inf]])
    return np.asarray(np.diff(norm.cdf(edges, mean, spread)))
