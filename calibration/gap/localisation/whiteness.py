"""Whether what a model cannot predict is noise: nothing of it should follow from what went before."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from calibration.gap.noise import ORDER, fit_autoregression, whiten, whole_windows
from calibration.gap.signals import CHANNELS, Signals
from onboard.arrays import FloatArray

_LONGEST = 1.0
"""s: lags that are looked at."""


@dataclass(frozen=True)
class Whiteness:
    """Autocorrelation of one channel's innovations.

    Attributes:
        channel: name in :data:`calibration.gap.signals.CHANNELS`.
        statistic: of Ljung and Box (Biometrika 65, 1978) over lags up to 1 s.
        p: of the statistic; tiny for any real signal of a minute.
        excess: sum of squared autocorrelations beyond that of white noise: about the share of the
            innovations' variance that their own past could still predict.
    """

    channel: str
    statistic: float
    p: float
    excess: float


def whiteness(signals: Signals, residual: FloatArray) -> list[Whiteness]:
    """Judge the innovations of each channel with data; an autoregressive model is fitted to it first.

    Args:
        signals: of the flights.
        residual: signals less everything that is explained, shape (n, 7), 0 where not valid.
    """
    whole = whole_windows(signals.valid, signals.bounds, ORDER)
    innovations = whiten(residual, whole, fit_autoregression(residual, whole))
    lags = max(2 * ORDER, round(_LONGEST / signals.dt))
    found = []
    for index, name in enumerate(CHANNELS):
        values, used = innovations[:, index], whole[:, index]
        if used.sum() <= lags:
            continue
        centred = np.where(used, values - values[used].mean(), 0.0)
        variance = float(np.mean(centred[used] ** 2))
        if variance == 0.0:
            continue
        rho, counts = np.empty(lags), np.empty(lags)
        for lag in range(1, lags + 1):
            both = used[lag:] & used[:-lag] & (signals.flight[lag:] == signals.flight[:-lag])
            counts[lag - 1] = max(int(both.sum()), 1)
            products = (centred[lag:] * centred[:-lag])[both].sum()
            rho[lag - 1] = products / counts[lag - 1] / variance
        statistic = float((counts * rho**2).sum())
        excess = float((rho**2 - 1.0 / counts).sum())
        found.append(Whiteness(name, statistic, float(chi2.sf(statistic, lags - ORDER)), excess))
    return found
