"""Errors of models on flights that no fit saw."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.data.found_effect import Improvement
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import CHANNELS, UNITS, Signals, stack_signals, window_means
from calibration.gap.estimate.model import Model
from calibration.measurement import drawn_again
from onboard.arrays import FloatArray, IntArray

WINDOW = 0.1
"""s that residuals are averaged over: shorter than anything that a vehicle does, longer than sensor noise."""

_DRAWS = 400


@dataclass(frozen=True)
class ChannelErrors:
    """Residuals of one model by flight and channel, averaged over :data:`WINDOW`.

    A single flight stands in parts, by whose scatter an interval is better than by none.

    Attributes:
        squares: sums of squares, shape (flights, 7).
        counts: number of windows, shape (flights, 7).
    """

    squares: FloatArray
    counts: FloatArray

    def rms(self, flights: IntArray | slice = slice(None)) -> FloatArray:
        """Root mean square of each channel, shape (..., 7), over flights (..., n)."""
        counts = np.maximum(self.counts[flights].sum(axis=-2), 1.0)
        return np.asarray(np.sqrt(self.squares[flights].sum(axis=-2) / counts))


class HeldOutFlights:
    """Flights that no fit sees."""

    def __init__(self, records: Sequence[FlightRecord]) -> None:
        self.records = tuple(records)
        self.signals: Signals = stack_signals(records)

    def errors(self, model: Model) -> ChannelErrors:
        """Residuals of a model; the battery's resting voltage, which is each flight's own, is taken out."""
        residual = np.where(self.signals.valid, self.signals.measured - model.predict(self.records), np.nan)
        window = max(1, round(WINDOW / self.signals.dt))
        signals = self.signals
        squares, counts = [], []
        for first, end in itertools.pairwise(signals.bounds if signals.flights > 1 else signals.part_bounds):
            means = window_means(residual[first:end], window)  # NaN where a sample of the window is not valid
            if np.isfinite(means[:, -1]).any():
                means[:, -1] -= np.nanmean(means[:, -1])
            squares.append(np.nansum(means**2, axis=0))
            counts.append(np.isfinite(means).sum(axis=0))
        return ChannelErrors(np.array(squares), np.array(counts, dtype=float))


def improvement(before: ChannelErrors, after: ChannelErrors, rng: np.random.Generator) -> Improvement:
    """What came from one model to the next, in the channel whose error fell by the largest share."""
    one, other = before.rms(), after.rms()
    channel = int(np.argmax(np.where(one > 0.0, 1.0 - other / np.maximum(one, 1e-300), -np.inf)))
    return Improvement.over(
        drawn_again(before.counts.shape[0], _DRAWS, rng),
        lambda flights: np.stack([model.rms(flights)[..., channel] for model in (before, after)], axis=-1),
        f"{CHANNELS[channel]} residual, means of {WINDOW:g} s, {UNITS[channel]}",
    )
