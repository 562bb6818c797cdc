"""One picture per named effect: what the data show without it, and what it says (component and residual).

Of the channels that tell of an effect it is drawn in the one in which it stands out most, over what it goes
with most.
"""

from collections.abc import Sequence

import numpy as np

from calibration.gap.data.signals import CHANNELS, KINDS, UNITS, Signals, window_means
from calibration.gap.estimate.model import kinds_that_tell
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.report.figures_data import AlongRegressor
from calibration.gap.unnamed.regressors import Regressor, regressors
from onboard.arrays import BoolArray, FloatArray

_WINDOW_S = 0.1
"""s that samples are averaged over."""

_BINS = 20
"""Of a regressor, by count, over which an effect's means are taken."""

_TELLING = 0.5
"""Share of an effect's variance that must go with a regressor; otherwise it is drawn over itself."""

_ITSELF = "what the effect says"


def effect_pictures(names: Sequence[str], final: Fitted, training: Training) -> tuple[AlongRegressor, ...]:
    """Pictures of these effects of a fit, in their order; none of an effect that does nothing here."""
    along = regressors(training.records)
    pictures = (_picture(name, final, training, along) for name in names)
    return tuple(picture for picture in pictures if picture is not None)


def _picture(
    name: str, final: Fitted, training: Training, along: Sequence[Regressor]
) -> AlongRegressor | None:
    signals = training.regression.signals
    says = final.predicted - final.model.without(name).predict(training.records)
    says = np.where(signals.valid, says, 0.0)
    power = (says**2).mean(axis=0) / final.estimate.noise.sigma**2
    power *= np.isin(np.arange(power.size), np.r_[tuple(KINDS[kind] for kind in kinds_that_tell([name]))])
    channel = int(np.argmax(power))
    if power[channel] == 0.0:
        return None
    valid = signals.valid[:, channel]
    said = averaged(says[:, channel], valid, signals)
    shares = [_share(averaged(one.values, valid, signals), said) for one in along]
    best = int(np.argmax(shares))
    itself = Regressor(_ITSELF, "", UNITS[channel], says[:, channel])
    shown = final.estimate.residual[:, channel] + says[:, channel]
    over = itself if shares[best] < _TELLING else along[best]
    return along_regressor(over, CHANNELS[channel], (shown, says[:, channel]), signals, name)


def along_regressor(
    regressor: Regressor,
    channel: str,
    readings: tuple[FloatArray, FloatArray],
    signals: Signals,
    effect: str = "",
) -> AlongRegressor:
    """Two readings of a channel, shape (n,) each, over a regressor, averaged over 0.1 s."""
    index = CHANNELS.index(channel)
    columns = [averaged(one, signals.valid[:, index], signals) for one in (regressor.values, *readings)]
    x, first, second = np.array(columns)[:, np.isfinite(columns).all(axis=0)]
    return AlongRegressor(
        channel=channel,
        channel_unit=UNITS[index],
        regressor=regressor.name,
        regressor_unit=regressor.unit,
        x=x,
        first=first,
        second=second,
        effect=effect,
    )


def averaged(values: FloatArray, valid: BoolArray, signals: Signals) -> FloatArray:
    """Means over 0.1 s, shape (k,), of rows (n,); NaN where not all of them are valid."""
    return window_means(np.where(valid, values, np.nan), max(1, round(_WINDOW_S / signals.dt)))


def _share(x: FloatArray, y: FloatArray) -> float:
    """Share of the variance of `y` that goes with `x`, by means over parts of equal count."""
    known = np.isfinite(x) & np.isfinite(y)
    if np.count_nonzero(known) < 2 * _BINS or np.ptp(x[known]) == 0.0:
        return 0.0
    ordered = y[known][np.argsort(x[known], kind="stable")]
    total = float(ordered.var())
    between = sum(part.size * (part.mean() - ordered.mean()) ** 2 for part in np.array_split(ordered, _BINS))
    return float(between / ordered.size / total) if total > 0.0 else 0.0
