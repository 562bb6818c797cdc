"""How long a step of thrust takes under the speed law: 63 % times and the first-order constants in its place.

Thrust is taken as proportional to the square of the speed; a share of a step then depends on speeds alone.
"""

import math
from dataclasses import dataclass

import numpy as np

from calibration.bench.motors.law import riccati_speed

SETTLED_SHARE = 1.0 - math.exp(-1.0)
"""63 %: what a first-order response has done after its time constant."""
_NEAR_ZERO = 1e-9
_HORIZON = 8.0
"""63 % times over which a first-order response is fitted."""
_NODES = 400


@dataclass(frozen=True, slots=True)
class ThrustStep:
    """A step of thrust, in gram-force (paper and operators speak so)."""

    start_gf: float
    end_gf: float

    @property
    def rising(self) -> bool:
        """Whether the thrust rises."""
        return self.end_gf > self.start_gf

    @property
    def label(self) -> str:
        """``5 -> 12 gf``."""
        return f"{self.start_gf:g} -> {self.end_gf:g} gf"


PAPER_UP = ThrustStep(5.0, 12.0)
PAPER_DOWN = ThrustStep(12.0, 0.0)
"""The steps that the paper's two time constants come from (bench notes 1.2)."""

STANDARD_STEPS = (
    ThrustStep(0.0, 5.0),
    ThrustStep(0.0, 12.0),
    PAPER_UP,
    ThrustStep(8.0, 10.0),
    ThrustStep(10.0, 8.0),
    ThrustStep(12.0, 5.0),
    PAPER_DOWN,
    ThrustStep(5.0, 0.0),
)
"""Steps that every result lists."""


def time_to_share(start: float, end: float, a: float, b: float, share: float = SETTLED_SHARE) -> float:
    """Time (s) until `share` of a step of thrust is done.

    Args:
        start, end: rad/s, speed before and settled.
        a, b: 1/s, 1/rad, of the speed law.
        share: of the change of the squared speed.
    """
    reached = math.sqrt(max(0.0, start**2 + share * (end**2 - start**2)))
    first, last = start - end, reached - end
    alpha = a + 2.0 * b * end
    if abs(alpha) < _NEAR_ZERO:
        return (1.0 / last - 1.0 / first) / b
    return math.log(first * (alpha + b * last) / (last * (alpha + b * first))) / alpha


def first_order_constant(start: float, end: float, a: float, b: float) -> float:
    """Time constant (s) of the first-order thrust that follows a step best, begun at the same moment.

    The mean square of the difference over the whole step is least; arguments as :func:`time_to_share`.
    """
    from scipy.optimize import brentq

    scale = time_to_share(start, end, a, b)
    t = np.linspace(0.0, _HORIZON * scale, _NODES)
    speed = riccati_speed(t, np.full(t.size, start), np.full(t.size, end), a, b)
    left = (speed**2 - end**2) / (start**2 - end**2)

    def slope(tau: float) -> float:
        decay = np.exp(-t / tau)
        return float(np.sum((decay - left) * decay * t))

    return float(brentq(slope, 0.05 * scale, 20.0 * scale, xtol=1e-12))


def local_constant(speed: float, a: float, b: float) -> float:
    """Time constant (s) of small changes about `speed` (rad/s), of speed and thrust alike: 1/(a + 2 b w)."""
    return 1.0 / (a + 2.0 * b * speed)
