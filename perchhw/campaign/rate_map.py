"""The landing rate over speed and angle, as far as the attempts so far tell it.

A Gaussian process over the logit of the rate, with binomial counts at the conditions of the grid: Laplace's
approximation (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, algorithms 3.1 and 3.2),
averaged over length scales and amplitudes by their evidence. Everything follows from the counts alone.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from onboard.arrays import FloatArray
from perchhw.campaign.plan import Condition

LENGTHS = (0.3, 0.8, 2.0)
"""Length scales along each axis, in widths of the grid: from a shore to hardly any change."""
AMPLITUDES = (1.5, 4.0)
"""Standard deviations of the logit: rates of 0.2 to 0.8, and of 0.02 to 0.98, are within one of them."""
_OFFSET = 1.5
"""Standard deviation of the logit of the mean rate."""
_JITTER = 1e-6
_NEWTON_STEPS = 12
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(15)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()


@dataclass(frozen=True)
class ExpectedRates:
    """What is known of the landing rate at n conditions.

    Attributes:
        rate: (n,) expected landing rate.
        deviation: (n,) its standard deviation.
        gain: (n,) by how much one more attempt there lowers the mean variance of all rates, to first order.
    """

    rate: FloatArray
    deviation: FloatArray
    gain: FloatArray

    @property
    def error(self) -> float:
        """Expected root mean square error of the map."""
        return float(np.sqrt(np.mean(self.deviation**2)))


class RateSurrogate:
    """Makes :class:`ExpectedRates` of counts at the n conditions of one grid.

    Attributes:
        prior: (h, n, n) covariance of the logits before the first attempt, by length scales and amplitude.
    """

    def __init__(self, conditions: Sequence[Condition]) -> None:
        places = np.asarray(conditions, dtype=float)
        extent = np.ptp(places, axis=0)
        places = (places - places.min(axis=0)) / np.where(extent > 0.0, extent, 1.0)
        apart = np.abs(places[:, None, :] - places[None, :, :])
        kernels = [
            amplitude**2 * _matern(np.hypot(apart[..., 0] / along, apart[..., 1] / across)) + _OFFSET**2
            for along, across, amplitude in itertools.product(LENGTHS, LENGTHS, AMPLITUDES)
        ]
        self.prior = np.stack(kernels)

    def fit(self, landed: FloatArray, flown: FloatArray) -> ExpectedRates:
        """The map after `landed` of `flown` attempts, (n,) each, at the conditions of the grid."""
        mean, covariance, weight = self.logits(landed, flown)
        spread = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        rates = _logistic(mean[..., None] + spread[..., None] * _NODES)  # (h, n, nodes)
        each = rates @ _WEIGHTS
        rate = weight @ each
        variance = weight @ ((rates**2) @ _WEIGHTS) - rate**2
        slope = (rates * (1.0 - rates)) @ _WEIGHTS
        information = each * (1.0 - each)
        own = np.diagonal(covariance, axis1=1, axis2=2)
        lowered = np.einsum("hi,hij->hj", slope**2, covariance**2) / (1.0 / information + own)
        return ExpectedRates(rate, np.sqrt(np.maximum(variance, 0.0)), weight @ lowered / rate.size)

    def logits(self, landed: FloatArray, flown: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mean (h, n) and covariance (h, n, n) of the logits after `landed` of `flown` attempts, and by its
        evidence the weight (h,) of each set of length scales and amplitude.
        """
        mean, covariance, evidence = self._laplace(landed, flown)
        weight = np.exp(evidence - evidence.max())
        return mean, covariance, weight / weight.sum()

    def _laplace(self, landed: FloatArray, flown: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mean (h, n) and covariance (h, n, n) of the logits, and log evidence (h,), by hyperparameters."""
        prior, seen = self.prior, np.flatnonzero(flown)
        landed, flown = landed[seen], flown[seen]
        if not seen.size:
            return np.zeros(prior.shape[:2]), prior, np.zeros(len(prior))
        inner = prior[:, seen[:, None], seen] + _JITTER * np.eye(seen.size)
        logit = np.zeros(inner.shape[:2])
        slope = np.zeros_like(logit)
        for _ in range(_NEWTON_STEPS):
            rate = _logistic(logit)
            root = np.sqrt(flown * rate * (1.0 - rate))
            target = root**2 * logit + landed - flown * rate
            inverse = np.linalg.inv(np.eye(seen.size) + root[:, :, None] * inner * root[:, None, :])
            pulled = (inverse @ (root * (inner @ target[..., None])[..., 0])[..., None])[..., 0]
            slope = target - root * pulled
            logit = (inner @ slope[..., None])[..., 0]
        likelihood = (landed * logit - flown * np.logaddexp(0.0, logit)).sum(axis=1)
        rate = _logistic(logit)
        root = np.sqrt(flown * rate * (1.0 - rate))
        scaled = np.eye(seen.size) + root[:, :, None] * inner * root[:, None, :]
        evidence = likelihood - 0.5 * (slope * logit).sum(axis=1) - 0.5 * np.linalg.slogdet(scaled)[1]
        across = prior[:, seen, :]
        mean = np.einsum("hsn,hs->hn", across, slope)
        weighted = root[:, :, None] * across
        covariance = prior - weighted.transpose(0, 2, 1) @ np.linalg.solve(scaled, weighted)
        return mean, covariance, evidence


def _matern(distance: FloatArray) -> FloatArray:
    """Matern covariance of smoothness 5/2 and variance 1; `distance` in length scales."""
    s = np.sqrt(5.0) * distance
    return (1.0 + s + s * s / 3.0) * np.exp(-s)


def _logistic(value: FloatArray) -> FloatArray:
    return 0.5 * (1.0 + np.tanh(0.5 * value))
