"""Which speeds to try next: those that narrow speed and spread most, whatever they are.

Bayesian D-optimal design (Chaloner and Verdinelli, Statist. Sci. 10, 273, 1995): the mean, over all pads that
the drops so far allow, of the log determinant of the information after the next drops. Speeds are taken one
after the other, a batch of drops each.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import log_ndtr

from calibration.bench.capture.drops import fall_height
from calibration.bench.capture.fit import CaptureFit
from onboard.arrays import FloatArray

BATCH = 10
"""Drops at each speed that is proposed."""
SPEEDS = 3

SLOWEST = 0.1
"""m/s: half a millimetre of fall; nobody drops a leg more slowly and knows it."""

_STEP = 0.05
_SPARSE = 8
_PRIOR_SIGMA = 1.0
"""m/s, of both parameters before any drop: keeps the information of drops that tell nothing regular."""


@dataclass(frozen=True)
class Advice:
    """What to drop next.

    Attributes:
        speeds: m/s, rising; BATCH drops at each.
        half_width: m/s, of the 95 % interval of the speed that these drops will leave, in the median.
    """

    speeds: tuple[float, ...]
    half_width: float

    def json_shape(self) -> dict[str, Any]:
        """As a JSON object."""
        rows = [{"speed_m_s": v, "height_m": fall_height(v), "drops": BATCH} for v in self.speeds]
        return {"next": rows, "expected_u95_m_s": self.half_width}

    def __str__(self) -> str:
        """In words."""
        listed = ", ".join(f"{v:.2f} m/s ({1000.0 * fall_height(v):.0f} mm of fall)" for v in self.speeds)
        return (
            f"next: {BATCH} drops each at {listed}: the speed will then be known to about "
            f"{self.half_width:.2f} m/s (95 %)"
        )


def next_drops(fit: CaptureFit) -> Advice:
    """The next speeds, up to half as fast again as any drop so far."""
    every = slice(None, None, _SPARSE)
    deviance = fit.deviance[every, every]
    mean, spread = (one.ravel() for one in np.meshgrid(fit.speeds[every], fit.spreads[every], indexing="ij"))
    weight = spread * np.exp(-0.5 * (deviance - deviance.min())).ravel()  # the grid is even in its logarithm
    weight /= weight.sum()
    now = np.zeros((mean.size, 3)) + np.array([1.0, 0.0, 1.0]) / _PRIOR_SIGMA**2
    for v, thrown in zip(fit.drops.speed, fit.drops.thrown, strict=True):
        now += thrown * _information(float(v), mean, spread)
    candidates = np.arange(SLOWEST, 1.5 * float(fit.drops.speed.max()) + _STEP, _STEP)
    offered = [BATCH * _information(float(v), mean, spread) for v in candidates]
    chosen: list[float] = []
    for _ in range(SPEEDS):
        gains = [float(weight @ np.log(_determinant(now + one))) for one in offered]
        best = int(np.argmax(gains))
        now = now + offered[best]
        chosen.append(round(float(candidates[best]), 2))
    sigma = np.sqrt(now[:, 2] / _determinant(now))
    order = np.argsort(sigma)
    median = sigma[order][np.searchsorted(np.cumsum(weight[order]), 0.5)]
    return Advice(tuple(sorted(chosen)), 1.96 * float(median))


def _information(v: float, mean: FloatArray, spread: FloatArray) -> FloatArray:
    """(n, 3) Fisher information of one drop: of the speed, mixed, of the spread."""
    z = (v - mean) / spread
    log_w = -z * z - np.log(2.0 * np.pi) - log_ndtr(z) - log_ndtr(-z)
    w = np.exp(log_w) / spread**2
    return np.stack([w, w * z, w * z * z], axis=1)


def _determinant(information: FloatArray) -> FloatArray:
    return information[:, 0] * information[:, 2] - information[:, 1] ** 2
