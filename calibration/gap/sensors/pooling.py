"""One mean over flights that each have a value and a standard error of their own (random effects)."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import stdtrit

from onboard.arrays import FloatArray

LEAST_Z = 4.0
"""Standard errors by which a mean must differ from zero."""

_TAIL = 5e-5  # of Student's t on either side: what many parameters in many campaigns may cross by chance


@dataclass(frozen=True)
class Pooled:
    """Mean over flights.

    Attributes:
        error: its standard error, from the scatter between flights.
        spread: standard deviation of the true values between flights.
    """

    mean: float
    error: float
    spread: float
    flights: int

    @property
    def interval(self) -> tuple[float, float]:
        """95 % confidence interval of the mean."""
        reach = float(stdtrit(self.flights - 1, 0.975)) * self.error
        return self.mean - reach, self.mean + reach

    @property
    def significant(self) -> bool:
        """Whether the mean differs from zero by 4 standard errors, and by more where flights are few."""
        quantile = float(stdtrit(self.flights - 1, 1.0 - _TAIL))
        return abs(self.mean) > max(LEAST_Z, quantile) * self.error

    def shrunk(self, value: float, error: float) -> float:
        """Best guess of one flight's true value from its own estimate and the others (empirical Bayes)."""
        share = self.spread**2 / (self.spread**2 + error**2)
        return self.mean + share * (value - self.mean)


def pool(values: FloatArray, errors: FloatArray) -> Pooled:
    """Pool `values` with standard `errors`, shape (n,) each, n >= 2.

    Spread by Paule and Mandel (1982); error of the mean by Hartung and Knapp (2001), never below that of the
    given errors.
    """
    count = values.size

    def excess(variance: float) -> float:
        weights = 1.0 / (errors**2 + variance)
        mean = float(weights @ values / weights.sum())
        return float(weights @ (values - mean) ** 2) - (count - 1)

    largest = float(np.ptp(values)) ** 2 + 1e-30
    variance = brentq(excess, 0.0, largest) if excess(0.0) > 0.0 > excess(largest) else 0.0
    weights = 1.0 / (errors**2 + variance)
    mean = float(weights @ values / weights.sum())
    ratio = float(weights @ (values - mean) ** 2) / (count - 1)
    return Pooled(mean, float(np.sqrt(max(ratio, 1.0) / weights.sum())), float(np.sqrt(variance)), count)
