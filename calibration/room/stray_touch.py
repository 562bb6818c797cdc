"""A touch of the ceiling that is off the plane of the others, told before a ceiling is taken from it.

Touches of one plane by a hand of standard uncertainty s leave residuals r with

    sum r^2 / s^2  distributed as chi2 with n - 3 degrees of freedom,

and more than what one in a hundred such sets leaves is no hand's. The touch that is off is the one without
which the others agree, and r_i / (1 - h_i) is by how much (h: diagonal of the hat matrix; Belsley, Kuh and
Welsch, Regression Diagnostics, 1980): without i the sum is less by r_i^2 / ((1 - h_i) s^2). Of four touches
whichever is left out the others agree; a fifth tells, best half way from the middle of a rectangle to that of
a side, on no line through two others.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from calibration.room.ceiling_plane import TOUCH_M
from onboard.arrays import FloatArray

FALSE_ALARM = 0.01
"""Share of plane ceilings touched by a steady hand of which something is said."""
_EXCLUDED = 2.0 * math.log(100.0)
"""By how much less the sum is without another touch where one is a hundred times less likely to be it."""
_OWN = 1e-9


@dataclass(frozen=True)
class StrayTouch:
    """Touches that are not on one plane.

    Attributes:
        numbers: of the touches, from 1, of which one may be off the plane of the others, the likeliest first;
            empty: no single one explains it.
        off: m, by how much the likeliest is, up counts positive.
    """

    numbers: tuple[int, ...]
    off: float


def stray_touch(touches: FloatArray) -> StrayTouch | None:
    """What is off one plane among the places, (n, 3), m; None: nothing that a hand does not explain."""
    rows = np.column_stack([np.ones(len(touches)), touches[:, :2]])
    hat = rows @ np.linalg.pinv(rows)
    residuals = touches[:, 2] - hat @ touches[:, 2]
    free = 1.0 - np.diag(hat)
    free[free < _OWN] = np.inf  # a touch that alone says how the plane tilts is off no other
    off = residuals / free
    gained = residuals * off / TOUCH_M**2
    misfit, freedom = float(residuals @ residuals) / TOUCH_M**2, len(touches) - 3
    if misfit <= chi2.isf(FALSE_ALARM, freedom):
        return None
    order = np.argsort(-gained, kind="stable")
    worst = order[0]
    numbers = tuple(int(one) + 1 for one in order if gained[worst] - gained[one] < _EXCLUDED)
    several = freedom > 1 and misfit - gained[worst] > chi2.isf(FALSE_ALARM, freedom - 1)
    return StrayTouch(() if several else numbers, float(off[worst]))
