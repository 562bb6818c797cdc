"""Which plain formula describes a place in the map best: a constant in a range, a polynomial, or a curve."""

from collections.abc import Sequence

import numpy as np

from calibration.gap.data.channels import (
    CHANNELS,
    ResidualChannel,
    attitudes,
    channel_valid,
    channel_values,
)
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import Signals
from calibration.gap.estimate.noise import ORDER, fit_autoregression, whiten, whole_windows
from calibration.gap.estimate.refine import UnnamedTerm
from calibration.gap.unnamed.blocks import Blocks, grouped_mean, make_blocks
from calibration.gap.unnamed.gap_map import Cell
from calibration.gap.unnamed.lines import SpectralLine
from calibration.gap.unnamed.normal_equations import Grid, whitened_equations
from calibration.gap.unnamed.profile import places
from calibration.gap.unnamed.regressors import Regressor
from calibration.gap.unnamed.terms import (
    curve_term,
    hats,
    inside,
    interval_term,
    line_term,
    polynomial_term,
    powers,
)
from onboard.arrays import BoolArray, FloatArray
from onboard.vehicle.unnamed import MOST_KNOTS

_FINE = 64
"""Knots between which the ends of a range are searched."""

_PER_PARAMETER = 5.0
"""Log-likelihood that a further parameter must gain."""

_MOST_POWERS = 3

_KNOTS = (5, 8, MOST_KNOTS)
"""Of curves."""

_CURVED = (0.005, 0.995)
"""Quantiles of a regressor between which a curve has its knots."""

_RARE = 1e-3
"""A range must tell at least this much of what all of the flights tell about any."""

Ends = tuple[float | None, float | None]


def unnamed_terms(
    cells: Sequence[Cell],
    lines: Sequence[SpectralLine],
    signals: Signals,
    records: Sequence[FlightRecord],
    residual: FloatArray,
) -> list[UnnamedTerm]:
    """A term for each place of the map and each line, in their order.

    Args:
        cells: that stand out.
        lines: that stand out.
        signals: of the flights.
        records: the flights, in the same order.
        residual: that the cells were found in, shape (n, 7), 0 where not valid.
    """
    turns, blocks = attitudes(records), make_blocks(signals)
    values, valid = channel_values(residual, turns), channel_valid(signals.valid)
    terms: list[UnnamedTerm] = []
    for cell in cells:
        index = CHANNELS.index(cell.channel)
        place = _Whitened(signals, blocks, values[:, index], valid[:, index])
        terms.append(_best_term(place, cell.channel, cell.regressor, turns))
    return [*terms, *(line_term(line.channel, line.frequency, signals) for line in lines)]


class _Whitened:
    """One channel's innovations, and how much of them columns explain."""

    def __init__(self, signals: Signals, blocks: Blocks, values: FloatArray, valid: BoolArray) -> None:
        self.signals, self.blocks = signals, blocks
        self.values, self.valid = values[:, None], valid[:, None]
        self.whole = whole_windows(self.valid, signals.bounds, ORDER)
        self.coefficients = fit_autoregression(self.values, self.whole)
        self.innovations = self._centred(self.values)[:, 0]
        self.sigma2 = float(np.mean(self.innovations[self.whole[:, 0]] ** 2))

    def gain(self, columns: FloatArray) -> float:
        """Log-likelihood gained by columns of the channel, shape (n, k)."""
        return self.fit(columns)[1]

    def fit(self, columns: FloatArray) -> tuple[FloatArray, float]:
        """Values of columns of the channel, shape (n, k), and the log-likelihood that they gain."""
        white = np.column_stack([self._centred(column[:, None])[:, 0] for column in columns.T])
        score = white.T @ self.innovations
        fitted = np.linalg.lstsq(white.T @ white, score, rcond=1e-10)[0]
        return np.asarray(fitted), float(0.5 * score @ fitted / self.sigma2)

    def _centred(self, column: FloatArray) -> FloatArray:
        white = whiten(column, self.whole, self.coefficients)
        used, part = self.whole[:, 0], self.signals.part
        means = grouped_mean(white[used], part[used], self.signals.part_bounds.size - 1)
        return np.where(self.whole, white - means[part], 0.0)

    def best_range(self, values: FloatArray) -> Ends:
        """The range of a regressor in which a constant explains most, by exact search over fine knots."""
        low, high = np.nanquantile(values, [0.005, 0.995])
        knots = np.linspace(low, high, _FINE)
        found = self._best_between(values, knots)
        half = 1.5 * (knots[1] - knots[0])
        near = [np.linspace(end - half, end + half, _FINE // 2) for end in found if end is not None]
        if not near:
            return found
        return self._best_between(values, np.unique(np.concatenate([[low, high], *near])))

    def _best_between(self, values: FloatArray, knots: FloatArray) -> Ends:
        """Range of neighbouring hat functions whose sum explains most."""
        grid = Grid(places(values, knots)[:, None], np.zeros((values.size, 1, 0)), knots.size)
        equations = whitened_equations(self.signals, self.blocks, self.values, self.valid, grid)
        matrix, score = equations.matrix.sum(axis=0)[0, 0], equations.score.sum(axis=0)[0, 0]
        below = np.pad(matrix.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
        reached = np.concatenate([[0.0], score.cumsum()])
        first, end = np.triu_indices(knots.size + 1, 1)
        information = below[end, end] - below[first, end] - below[end, first] + below[first, first]
        enough = information > _RARE * information.max()
        gain = np.where(
            enough, (reached[end] - reached[first]) ** 2 / np.where(enough, information, 1.0), 0.0
        )
        best = int(np.argmax(gain))
        i, j = int(first[best]), int(end[best])
        ends = 0.5 * (knots[1:] + knots[:-1])
        return (None if i == 0 else float(ends[i - 1]), None if j == knots.size else float(ends[j - 1]))


def _best_term(
    place: _Whitened, channel: ResidualChannel, regressor: Regressor, turns: FloatArray
) -> UnnamedTerm:
    values = regressor.values
    ends = _smaller_side(place.best_range(values), values)
    parameters = 1 + sum(end is not None for end in ends)
    in_range = place.gain(inside(values, *ends)[:, None]) - _PER_PARAMETER * parameters
    centre = _centre(values)
    by_degree = [
        place.gain(powers(values, centre, degree)) - _PER_PARAMETER * degree
        for degree in range(1, _MOST_POWERS + 1)
    ]
    low, high = np.nanquantile(values, _CURVED)
    curves = [np.linspace(low, high, count) for count in _KNOTS]
    by_knots = [place.gain(hats(values, knots)) - _PER_PARAMETER * (knots.size - 1) for knots in curves]
    if max(by_knots) > max(in_range, *by_degree):
        knots = curves[int(np.argmax(by_knots))]
        return curve_term(channel, regressor, knots, _level(place, values, knots), turns)
    if max(by_degree) > in_range:
        return polynomial_term(channel, regressor, centre, int(np.argmax(by_degree)) + 1, turns)
    return interval_term(channel, regressor, ends, turns)


def _level(place: _Whitened, values: FloatArray, knots: FloatArray) -> int:
    """Index of the knot at which a curve is as large as it is half of the time: there is nothing there."""
    columns = hats(values, knots)
    fitted, _ = place.fit(columns)
    order = np.argsort(fitted)
    time = np.cumsum(columns.sum(axis=0)[order])
    return int(order[np.searchsorted(time, 0.5 * time[-1])])


def _smaller_side(ends: Ends, values: FloatArray) -> Ends:
    """Of a range that is open on one side, or what it leaves out, the one with less time in it."""
    low, high = ends
    if (low is None) == (high is None):
        return ends
    if np.mean(inside(values, low, high)[np.isfinite(values)]) <= 0.5:
        return ends
    return high, low


def _centre(values: FloatArray) -> float:
    """0 where the flights pass it, else a round number near the median."""
    low, middle, high = np.nanquantile(values, [0.05, 0.5, 0.95])
    return 0.0 if low < 0.0 < high else float(f"{middle:.2g}")
