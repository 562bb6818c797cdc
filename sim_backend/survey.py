"""A person who surveys a simulated room: turns the drone on its mark, then touches the ceiling with a wand.

From the start of the fault's window on, a span of its duration each: the drone stands turned by half a turn,
then it is back and the wand is at the ceiling in one corner after the other, then gone. As a hand does, with
errors: 0.5 mm where the drone is put, 0.3 mm at a touch, some degrees in the heading. A corner may be missed:
as if told so, the person then touches a fifth point and, twice over, all the corners again.
"""

import math
from typing import NamedTuple

import numpy as np

from onboard.arrays import Quaternion, Vector
from onboard.room import RoomGeometry
from sim_backend.fault_values import FaultWindow, integer, number, vector

WAND = "wand"
"""Name of the wand in the motion capture; its origin is the centre of the marker that touches."""
MARKER_RADIUS = 0.007
"""m."""
_CORNERS = ((-0.8, -0.6), (-0.8, 0.6), (0.9, 0.6), (0.9, -0.6))
_FIFTH = (0.05, 0.3)
_PLACED_M, _TOUCH_M, _HEADING_RAD = 0.5e-3, 0.3e-3, math.radians(3.0)
_HANDS = 2
"""Stream of random numbers of the hands."""
_LEVEL: Quaternion = (0.0, 0.0, 0.0, 1.0)


class CeilingTruth(NamedTuple):
    """Height over x = y = 0 (m), tilts along x and y (rad) of the ceiling that is touched."""

    height: float
    tilt_x: float
    tilt_y: float


def ceiling_truth(text: str) -> CeilingTruth:
    """``H,X,Y`` in m and deg."""
    height, tilt_x, tilt_y = vector(text)
    return CeilingTruth(height, math.radians(tilt_x), math.radians(tilt_y))


class MissedTouch(NamedTuple):
    """A corner, from 1, and by how much the marker is below the ceiling there at first (m)."""

    corner: int
    below: float


def missed_touch(text: str) -> MissedTouch:
    """``N,MM``."""
    corner, _, below = text.partition(",")
    try:
        return MissedTouch(integer(1, 2, 3, 4)(corner), 1e-3 * number(0.0, 100.0)(below))
    except ValueError:
        raise ValueError("must be a corner, 1 to 4, and at most 100 mm: N,MM") from None


class SimulatedSurvey:
    """What the person does when.

    Args:
        window: start (s) and duration of one span; :data:`sim_backend.fault_values.NO_TIME`: nobody comes.
        ceiling: of the room; None: that of `room`. The drone meets that of `room` in any case.
        missed: a corner that is not touched at first.
        room: the simulated room.
        seed: of the hand's errors.
    """

    def __init__(
        self,
        window: FaultWindow,
        ceiling: CeilingTruth | None,
        missed: MissedTouch | None,
        room: RoomGeometry,
        seed: int,
    ) -> None:
        self._window = window
        self._ceiling = ceiling or CeilingTruth(room.ceiling_z, 0.0, 0.0)
        rng = np.random.default_rng((seed, _HANDS))
        self.heading = math.pi + _HEADING_RAD * float(rng.standard_normal())
        aside = _PLACED_M * rng.standard_normal(2)
        self.aside = (float(aside[0]), float(aside[1]))
        places = _CORNERS if missed is None else (*_CORNERS, _FIFTH, *_CORNERS, *_CORNERS)
        self._touches = [self._touch(x, y, _TOUCH_M * float(rng.standard_normal())) for x, y in places]
        if missed is not None:
            x, y, z = self._touches[missed.corner - 1]
            self._touches[missed.corner - 1] = (x, y, z - missed.below)

    def turns(self, time: float) -> bool:
        """Whether the drone stands turned at `time` (s)."""
        return self._span(time) == 0

    def wand(self, time: float) -> tuple[str, Vector, Quaternion] | None:
        """The wand as motion capture sees it at `time` (s); None: it is in nobody's hand."""
        span = self._span(time)
        if span is None or not 1 <= span <= len(self._touches):
            return None
        return WAND, self._touches[span - 1], _LEVEL

    def _span(self, time: float) -> int | None:
        if time < self._window.start:
            return None
        return int((time - self._window.start) / (self._window.end - self._window.start))

    def _touch(self, x: float, y: float, error: float) -> Vector:
        slope_x, slope_y = math.tan(self._ceiling.tilt_x), math.tan(self._ceiling.tilt_y)
        below = MARKER_RADIUS * math.sqrt(1.0 + slope_x**2 + slope_y**2)
        return x, y, self._ceiling.height + slope_x * x + slope_y * y - below + error
