"""The psychometric function of a pad: P(stick | v) = Phi((v - speed) / spread), as `pad_capture` has it.

A probit fit by maximum likelihood (Finney, Probit Analysis, 1971) with limits from the profile likelihood,
which hold with few drops and where Wald's do not: with complete separation, where every fast drop stuck and
every slow one did not, the likelihood has no maximum inside (Albert and Anderson, Biometrika 71, 1, 1984).
The speed is then known to lie around the gap, and the spread has an upper limit alone. The likelihood is
laid out on a grid, and on a finer one over what the coarse one leaves, so that nothing has to converge.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import log_ndtr
from scipy.stats import chi2

from calibration.bench.capture.drops import Drops
from calibration.measurement import COVERAGE, Estimate
from onboard.arrays import BoolArray, FloatArray, IntArray
from onboard.vehicle import EFFECTS

Interval = tuple[float, float]

_RULES = EFFECTS["pad_capture"].parameters
LOWEST, HIGHEST = _RULES["speed"].low, _RULES["speed"].high
SHARPEST, WIDEST = 0.005, _RULES["spread"].high
"""m/s: ends of the grid; a spread below the first is none that a bench can see."""

_CELLS = 120
_DROP = float(chi2.ppf(COVERAGE, 1))
"""Twice the log likelihood that a parameter may lose within its 95 % limits."""
_KEPT = 20.0
"""Likewise, of what the finer grid covers."""


@dataclass(frozen=True)
class CaptureFit:
    """What drops say of a pad.

    Attributes:
        drops: that were made.
        speed: m/s, at which half of the touches stick; half-way through the gap where drops are separated.
        spread: m/s, standard deviation of that speed from drop to drop; 0 where drops are separated.
        speed_interval, spread_interval: 95 %, profile likelihood; cut off at the ends of the grid.
        speeds: (n,) grid, m/s. spreads: (m,) grid, m/s, evenly spaced in their logarithm.
        deviance: (n, m) twice the log likelihood below the largest.
        rise: twice the log likelihood above that of one rate for all speeds; negative where it falls.
    """

    drops: Drops
    speed: float
    spread: float
    speed_interval: Interval
    spread_interval: Interval
    speeds: FloatArray
    spreads: FloatArray
    deviance: FloatArray
    rise: float

    @property
    def estimates(self) -> dict[str, Estimate]:
        """Parameters of `pad_capture`, with the longer arm of each interval on both sides."""
        return {
            "speed": _estimate(self.speed, self.speed_interval),
            "spread": _estimate(self.spread, self.spread_interval),
        }

    @property
    def rises(self) -> bool:
        """Whether more stick at higher speeds, beyond chance."""
        return self.rise > _DROP

    @property
    def misfit(self) -> float | None:
        """Probability of scatter around the curve as large as this; None with fewer than 3 speeds of 5 drops.

        Likelihood ratio against a rate of its own at each speed.
        """
        many = self.drops.thrown >= 5
        if np.count_nonzero(many) < 3:
            return None
        speed, thrown, stuck = self.drops.speed[many], self.drops.thrown[many], self.drops.stuck[many]
        own = _rate_likelihood(stuck, thrown)
        z = (speed - self.speed) / max(self.spread, SHARPEST)
        fitted = stuck * log_ndtr(z) + (thrown - stuck) * log_ndtr(-z)
        return float(chi2.sf(2.0 * float(np.sum(own - fitted)), max(int(many.sum()) - 2, 1)))


def fit_drops(drops: Drops) -> CaptureFit:
    """Fit speed and spread. Drops that all ended alike have a fit too: its intervals reach the grid's end."""
    speeds = np.linspace(LOWEST, HIGHEST, 4 * _CELLS + 1)
    spreads = np.geomspace(SHARPEST, WIDEST, _CELLS // 2 + 1)
    for _ in range(2):
        kept = _losses(_likelihood(drops, speeds, spreads)) < _KEPT
        speeds = np.linspace(*_around(speeds, np.any(kept, axis=1)), 2 * _CELLS + 1)
        spreads = np.geomspace(*_around(spreads, np.any(kept, axis=0)), _CELLS + 1)
    likelihood = _likelihood(drops, speeds, spreads)
    deviance = _losses(likelihood)
    row, column = np.unravel_index(np.argmin(deviance), deviance.shape)
    speed, spread = float(speeds[row]), float(spreads[column])
    if drops.separated:
        speed, spread = _gap_centre(drops), 0.0
    low, high = _limits(speeds, deviance.min(axis=1))
    narrow, wide = _limits(spreads, deviance.min(axis=0))
    even = _rate_likelihood(drops.stuck.sum(keepdims=True), drops.thrown.sum(keepdims=True))
    rise = 2.0 * (float(likelihood.max()) - float(even[0]))
    return CaptureFit(
        drops=drops,
        speed=speed,
        spread=spread,
        speed_interval=(min(low, speed), max(high, speed)),
        spread_interval=(0.0 if narrow <= SHARPEST else narrow, max(wide, spread)),
        speeds=speeds,
        spreads=spreads,
        deviance=deviance,
        rise=rise,
    )


def _likelihood(drops: Drops, speeds: FloatArray, spreads: FloatArray) -> FloatArray:
    """Log likelihood (n, m)."""
    total = np.zeros((speeds.size, spreads.size))
    for v, thrown, stuck in zip(drops.speed, drops.thrown, drops.stuck, strict=True):
        z = (v - speeds[:, None]) / spreads
        total += (stuck * log_ndtr(z) if stuck else 0.0) + (
            (thrown - stuck) * log_ndtr(-z) if stuck < thrown else 0.0
        )
    return total


def _losses(likelihood: FloatArray) -> FloatArray:
    return 2.0 * (likelihood.max() - likelihood)


def _around(grid: FloatArray, kept: BoolArray) -> Interval:
    """Ends of what is kept, with one cell more on each side."""
    inside = np.flatnonzero(kept)
    return float(grid[max(inside[0] - 1, 0)]), float(grid[min(inside[-1] + 1, grid.size - 1)])


def _limits(grid: FloatArray, loss: FloatArray) -> Interval:
    """Where a profile crosses the limit, between cells; the grid's ends where it does not."""
    inside = np.flatnonzero(loss <= _DROP)
    first, last = int(inside[0]), int(inside[-1])
    low = (
        grid[0]
        if first == 0
        else np.interp(-_DROP, -loss[first - 1 : first + 1], grid[first - 1 : first + 1])
    )
    high = (
        grid[-1] if last == grid.size - 1 else np.interp(_DROP, loss[last : last + 2], grid[last : last + 2])
    )
    return float(low), float(high)


def _gap_centre(drops: Drops) -> float:
    edges = [(a, b) for a, b in pairwise(range(drops.speed.size)) if drops.stuck[a] == 0 < drops.stuck[b]]
    (before, after), *_ = edges
    return 0.5 * float(drops.speed[before] + drops.speed[after])


def _rate_likelihood(stuck: IntArray, thrown: IntArray) -> FloatArray:
    """Log likelihood of counts under their own rate."""
    rate = np.asarray(stuck / thrown, dtype=np.float64)
    fell = np.asarray(thrown - stuck, dtype=np.float64)
    held = np.asarray(stuck, dtype=np.float64)
    one = np.where(held > 0, held * np.log(np.where(held > 0, rate, 1.0)), 0.0)
    return one + np.where(fell > 0, fell * np.log(np.where(fell > 0, 1.0 - rate, 1.0)), 0.0)


def _estimate(value: float, interval: Interval) -> Estimate:
    """Sigma is a quarter of the interval's width, as for a normal one."""
    low, high = interval
    sigma = 0.5 * (high - low) / float(np.sqrt(_DROP))
    return Estimate(value, "m/s", sigma, half_interval=max(high - value, value - low))
