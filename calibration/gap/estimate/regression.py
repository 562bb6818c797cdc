"""One linearised estimate: shared effects, nuisances and coloured noise, fitted together."""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.data.signals import CHANNELS, KINDS, Signals
from calibration.gap.estimate.mixed import FIRST_SPREAD, MixedFit, Prior, Products, fit_mixed
from calibration.gap.estimate.noise import ORDER, fit_autoregression, whiten, whiten_channel, whole_windows
from calibration.gap.estimate.nuisances import nuisance_columns
from onboard.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class Noise:
    """Model of the noise: autoregressive coefficients (channels, order), innovation sigma (channels,)."""

    coefficients: FloatArray
    sigma: FloatArray


@dataclass(frozen=True)
class LinearisedFit:
    """A linearised fit about one model.

    Attributes:
        fit: shared effects (steps from the model's values) and nuisances.
        by_kind: the shares of these that forces, torques and the battery's voltage have.
        residual: signals less prediction, nuisances and fitted effects, shape (n, 7), not whitened.
    """

    fit: MixedFit
    products: Products
    by_kind: tuple[Products, ...]
    noise: Noise
    residual: FloatArray


class Regression:
    """The signals of some flights, ready for fits about any model.

    Attributes:
        weights: of each part in each channel, shape (parts, 7) (:mod:`calibration.gap.data.excitation`).
        whole: rows that have a complete past, shape (n, 7).
    """

    def __init__(self, signals: Signals, weights: FloatArray) -> None:
        self.signals = signals
        self.weights = weights
        self._root: FloatArray = np.ascontiguousarray(np.sqrt(weights)[signals.part].T)
        self.whole: BoolArray = whole_windows(signals.valid, signals.bounds, ORDER)
        self._whole_by_channel: BoolArray = np.ascontiguousarray(self.whole.T)

    def misfit(self, predicted: FloatArray) -> FloatArray:
        """Signals less prediction, shape (n, 7); 0 where not valid."""
        return np.where(self.signals.valid, self.signals.measured - predicted, 0.0)

    def fit_noise(self, residual: FloatArray) -> Noise:
        """Noise model of a residual, shape (n, 7), less its mean in each part.

        What a part has of its own is a nuisance, not noise. A model that has learned the mean that is left
        where a nuisance was kept small takes all of it for noise from then on: what is missing would depend
        on where a fit began.
        """
        residual = self._centred(residual)
        coefficients = fit_autoregression(residual, self.whole)
        innovations = whiten(residual, self.whole, coefficients)
        counts = np.maximum(self.whole.sum(axis=0), 1)
        sigma = np.sqrt((innovations**2).sum(axis=0) / counts)
        return Noise(coefficients, np.where(sigma > 0.0, sigma, 1.0))

    def whitened(self, columns: Sequence[FloatArray], noise: Noise) -> FloatArray:
        """Columns, (n, 7) each, as weighted innovations in units of their sigma: shape (7, columns, n)."""
        table = np.zeros((len(CHANNELS), len(columns), self.signals.valid.shape[0]))
        units = self._root / noise.sigma[:, None]
        for index, column in enumerate(columns):
            for channel, values in enumerate(column.T):
                if values.any():
                    row, whole = table[channel, index], self._whole_by_channel[channel]
                    whiten_channel(np.ascontiguousarray(values), whole, noise.coefficients[channel], row)
                    row *= units[channel]
        return table

    def products(
        self,
        table: FloatArray,
        residual: FloatArray,
        nuisances: int,
        noise: Noise,
        channels: slice = slice(None),
    ) -> Products:
        """Products of whitened columns per part.

        Args:
            table: nuisances, then effects, from :meth:`whitened`.
            residual: signals less prediction, shape (n, 7), not whitened.
            nuisances: how many of the columns are nuisances.
            noise: that the columns were whitened with.
            channels: that count.
        """
        bounds, count = self.signals.part_bounds, table.shape[1] + 1
        left = self.whitened([residual], noise)
        sums = np.zeros((bounds.size - 1, count, count))
        for columns, last in zip(table[channels], left[channels], strict=True):
            used = np.flatnonzero([*columns.any(axis=1), True])
            rows = np.vstack([columns[used[:-1]], last])
            for part, (first, end) in enumerate(itertools.pairwise(bounds)):
                sums[part][np.ix_(used, used)] += rows[:, first:end] @ rows[:, first:end].T
        counts = np.add.reduceat(self.whole.astype(float), bounds[:-1], axis=0)
        q = nuisances
        return Products(
            zz=sums[:, :q, :q],
            zx=sums[:, :q, q:-1],
            xx=sums[:, q:-1, q:-1],
            zr=sums[:, :q, -1],
            xr=sums[:, q:-1, -1],
            rr=sums[:, -1, -1],
            constant=-(self.weights * counts)[:, channels] @ np.log(noise.sigma[channels]),
        )

    def estimate(
        self,
        predicted: FloatArray,
        columns: Sequence[FloatArray],
        prior: Prior,
        spread: FloatArray = FIRST_SPREAD,
        noise: Noise | None = None,
    ) -> LinearisedFit:
        """Fit effects and nuisances under a noise model.

        Args:
            predicted: shape (n, 7), of the model about which is linearised.
            columns: derivatives by each variable, shape (n, 7) each.
            prior: of the step of each variable from its present value.
            spread: of the nuisances, to begin with.
            noise: without one it is fitted to what the model leaves.
        """
        nuisances = nuisance_columns(self.signals, predicted)
        raw = self.misfit(predicted)
        noise = self.fit_noise(raw) if noise is None else noise
        table = self.whitened([*nuisances, *columns], noise)
        by_kind = tuple(self.products(table, raw, len(nuisances), noise, kind) for kind in KINDS)
        products = functools.reduce(Products.__add__, by_kind)
        fit = fit_mixed(products, prior, spread)
        return LinearisedFit(fit, products, by_kind, noise, self._left(raw, columns, nuisances, fit))

    def _left(
        self, raw: FloatArray, columns: Sequence[FloatArray], nuisances: FloatArray, fit: MixedFit
    ) -> FloatArray:
        left = raw.copy()
        for column, value in zip(columns, fit.theta, strict=True):
            left -= value * column
        per_row = fit.per_part[self.signals.part]
        for index, nuisance in enumerate(nuisances):
            left -= per_row[:, index, None] * nuisance
        return np.where(self.signals.valid, left, 0.0)

    def _centred(self, raw: FloatArray) -> FloatArray:
        starts = self.signals.part_bounds[:-1]
        count = np.maximum(np.add.reduceat(self.signals.valid.astype(float), starts, axis=0), 1.0)
        mean = np.add.reduceat(raw, starts, axis=0) / count
        return np.where(self.signals.valid, raw - mean[self.signals.part], 0.0)
