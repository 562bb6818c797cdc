"""Which way a bare rotor turns, as the gyro tells it: who speeds a rotor up is turned the other way.

Only of a drone that is free to turn: on a desk or in a fist the torque of a bare rotor, 0.5 mN m for some
10 ms, moves nothing. Hung on a thread the drone keeps the angular momentum that it got until the rotor stops,
so that its rate about the vertical makes a step at each start and the opposite one at each stop. A hand, a
draught or the thread may make steps as well; they do not know when the motor is switched. The place of a
motor does not enter: its torque is the same everywhere.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from onboard.arrays import FloatArray

SETTLED_S = 0.2
"""s after a switch: by then a bare rotor has its speed, or stands."""
LEAST = 1.0
"""deg/s: a smaller step is not that of a drone which is free to turn (3 to 10 for the paper's vehicle)."""
CLEAR = 5.0
"""Standard errors: a step that is not clear of the other motions tells nothing."""
_FEWEST_STEPS, _FEWEST_SAMPLES = 4, 8
_WAYS: Final = ("ccw", "cw")


@dataclass(frozen=True, slots=True)
class Reaction:
    """How the drone answered a motor that started and stopped some times.

    Attributes:
        step: deg/s about b_z, mean step of the rate when it starts; positive counter-clockwise from above.
        error: deg/s, its standard error, from how the steps scatter; infinite without enough of them.
    """

    step: float
    error: float

    @property
    def direction(self) -> str | None:
        """ "cw" or "ccw" seen from above; None where the gyro cannot tell."""
        clear = abs(self.step) >= max(LEAST, CLEAR * self.error)
        return _WAYS[self.step > 0.0] if clear else None


def reaction(times: FloatArray, rates: FloatArray, driven: NDArray[np.bool_]) -> Reaction:
    """The steps of the rate where the motor is switched.

    Args:
        times: (n,), drone time, s.
        rates: (n,), about b_z, deg/s.
        driven: (n,), whether the motor has a set-point.
    """
    switches = np.flatnonzero(driven[1:] != driven[:-1]) + 1
    bounds = [0, *switches.tolist(), len(times)]
    steps = []
    for before, switch, after in zip(bounds, bounds[1:], bounds[2:], strict=False):
        at = 0.5 * float(times[switch - 1] + times[switch])
        was = _rate_at(at, times[before:switch], rates[before:switch], before > 0)
        is_now = _rate_at(at, times[switch:after], rates[switch:after], True)
        if was is not None and is_now is not None:
            steps.append((is_now - was) if driven[switch] else (was - is_now))
    if len(steps) < _FEWEST_STEPS:
        return Reaction(0.0, math.inf)
    return Reaction(float(np.mean(steps)), float(np.std(steps, ddof=1)) / math.sqrt(len(steps)))


def _rate_at(at: float, times: FloatArray, rates: FloatArray, after_a_switch: bool) -> float | None:
    """Rate (deg/s) at a time (s) by the line through samples of a motor that has settled; None: too few."""
    settled = times >= times[0] + SETTLED_S if after_a_switch else np.ones(len(times), dtype=bool)
    if np.count_nonzero(settled) < _FEWEST_SAMPLES:
        return None
    t = times[settled] - at
    return float(np.polynomial.Polynomial.fit(t, rates[settled], 1)(0.0))
