"""Motor commands that came over a radio: what was made up between and after the packets."""

from dataclasses import dataclass

import numpy as np

from calibration.gap.prepare.grid import Samples
from onboard.arrays import BoolArray

FULL_SCALE = 65535.0
"""PWM of full voltage."""

_STRAIGHT_COUNTS = 2.0  # a second difference below this is that of a straight line
_STRAIGHT_INTERVALS = 5


@dataclass(frozen=True)
class MotorLog:
    """Motor commands with what was made up taken out.

    Attributes:
        samples: PWM of the four motors, the samples that were measured.
        lost_s: time within the log that was interpolated (s).
        dead_s: time at its end that was extrapolated (s).
        clipped: samples that were outside of 0..65535.
    """

    samples: Samples
    lost_s: float
    dead_s: float
    clipped: int


def measured_commands(pwm: Samples) -> MotorLog:
    """Take radio gaps and the dead end out of `pwm`, shape (n, 4), and clip the rest to 0..65535.

    A controller's commands never lie on a straight line: where the second difference of all four motors
    stays below 2 counts for 5 intervals or more, the log was interpolated (or held). The same at the end is
    what is left of a lost link. Motors that are off are no gap.
    """
    straight = _straight(pwm)
    off = np.all(pwm.values == 0.0, axis=1)
    made_up = _runs_of(straight, _STRAIGHT_INTERVALS) & ~off
    measured = np.flatnonzero(~made_up)
    last = int(measured[-1]) if measured.size else 0
    # The last sample before a straight line is measured, the end of the line is not: it has no bend.
    dead = np.zeros(pwm.t.size, dtype=np.bool_)
    if made_up[pwm.t.size - 2] and not off[-1]:
        last = int(np.flatnonzero(~made_up[:-1])[-1]) if np.any(~made_up[:-1]) else 0
        dead[last + 1 :] = True
    keep = ~made_up & ~dead
    clipped = (pwm.values < 0.0) | (pwm.values > FULL_SCALE)
    steps = np.append(np.diff(pwm.t), 0.0)
    return MotorLog(
        samples=Samples(pwm.t[keep], np.clip(pwm.values[keep], 0.0, FULL_SCALE)),
        lost_s=float(np.sum(steps[made_up & ~dead])),
        dead_s=float(pwm.t[-1] - pwm.t[last]) if dead.any() else 0.0,
        clipped=int(np.count_nonzero(np.any(clipped, axis=1) & keep)),
    )


def _straight(pwm: Samples) -> BoolArray:
    """Samples that lie on the line between their neighbours, in all four motors; the ends do not."""
    t, v = pwm.t, pwm.values
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    bend = 2.0 * (v[:-2] + share * (v[2:] - v[:-2]) - v[1:-1])  # the second difference, on a uniform grid
    straight = np.zeros(t.size, dtype=np.bool_)
    straight[1:-1] = np.all(np.abs(bend) < _STRAIGHT_COUNTS, axis=1)
    return straight


def _runs_of(mask: BoolArray, least: int) -> BoolArray:
    """`mask` without its runs that are shorter than `least` samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    kept = np.zeros(mask.size, dtype=np.bool_)
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        kept[start:end] = end - start >= least
    return kept
