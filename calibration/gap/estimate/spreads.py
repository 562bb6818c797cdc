"""Spreads of nuisances by maximum likelihood: Fisher scoring.

Expectation-maximisation has the same fixed point, but creeps towards it where the flights say little about a
nuisance: a trim that differs between flights by ten times what was assumed took 300 rounds. The information
about all spreads, of which it makes no use, says how far to go (Jennrich, Sampson, Technometrics 18, 1976).
"""

import numpy as np

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.nuisances import NUISANCES, SPREADS, STEADY
from onboard.arrays import FloatArray

_OWN = len(NUISANCES)
_LEAST, _MOST = np.array([s.least for s in SPREADS]), np.array([s.most for s in SPREADS])

_OF_SPREAD = np.vstack([np.tile(np.eye(_OWN, len(SPREADS)), (PARTS, 1)), np.eye(len(SPREADS))[_OWN:]])
"""Which spread each nuisance of a flight has: those of its parts, then what it has as a whole."""

_LONGEST = 1.0
"""Logarithm of the factor by which a spread changes in one step, at most."""

_ENOUGH = 0.01
"""Log-likelihood that a step promises: less decides nothing."""

_MOST_STEPS = 100

_RIDGE = 0.01
"""Information about the logarithm of a spread that the flights say nothing about."""


class Scoring:
    """The search for the most likely spreads.

    Args:
        zz: products of the whitened nuisances of each part, shape (parts, q, q).
        spread: to begin with, over parts, then over flights.

    Attributes:
        spread: at present.
        settled: whether the last step promised next to nothing.
    """

    def __init__(self, zz: FloatArray, spread: FloatArray) -> None:
        self.spread, self.settled = spread, False
        flights = zz.shape[0] // PARTS
        self._count = np.where(np.arange(spread.size) < _OWN, flights * PARTS, flights)
        self._products = _of_flights(zz)
        self._last = np.zeros(spread.size)
        self._longest = np.full(spread.size, _LONGEST)
        self._steps = 0

    @property
    def exhausted(self) -> bool:
        """Whether it has gone on for longer than such a search ever takes."""
        return self._steps >= _MOST_STEPS

    def step(self, squares: FloatArray) -> None:
        """Go on.

        Args:
            squares: mean expected square of each nuisance under the present spreads.
        """
        gradient = self._count * (squares / self.spread**2 - 1.0)
        outwards = np.where(gradient > 0.0, self.spread >= _MOST, self.spread <= _LEAST)
        free = np.flatnonzero(~outwards)
        information = _information(self._products, self.spread)[np.ix_(free, free)]
        wanted = np.zeros(self.spread.size)
        wanted[free] = np.linalg.solve(information + _RIDGE * np.eye(free.size), gradient[free])
        after = np.clip(self.spread * np.exp(np.clip(wanted, -self._longest, self._longest)), _LEAST, _MOST)
        moved = np.log(after / self.spread)
        # To and fro means that steps are too long.
        turned = moved * self._last < 0.0
        self._longest = np.minimum(np.where(turned, 0.5 * np.abs(moved), 2.0 * self._longest), _LONGEST)
        self._last, self.spread = moved, after
        self._steps += 1
        self.settled = bool(np.abs(gradient * moved).sum() < _ENOUGH)


def _information(of_flights: FloatArray, spread: FloatArray) -> FloatArray:
    """Expected information about the logarithms of the spreads."""
    of_each = _OF_SPREAD @ spread
    known = np.eye(of_each.size) + of_each[:, None] * of_flights * of_each
    told = np.eye(of_each.size) - np.linalg.inv(known)
    return np.asarray(2.0 * _OF_SPREAD.T @ (told**2).sum(axis=0) @ _OF_SPREAD)


def _of_flights(zz: FloatArray) -> FloatArray:
    """Products of all nuisances of a flight, of its parts and as a whole, shape (flights, n, n)."""
    parts = zz.reshape(-1, PARTS, _OWN, _OWN)
    size = PARTS * _OWN + len(STEADY)
    table = np.zeros((parts.shape[0], size, size))
    whole = slice(PARTS * _OWN, None)
    for part in range(PARTS):
        rows = slice(part * _OWN, (part + 1) * _OWN)
        table[:, rows, rows] = parts[:, part]
        table[:, rows, whole] = parts[:, part][:, :, STEADY]
        table[:, whole, rows] = parts[:, part][:, STEADY]
        table[:, whole, whole] += parts[:, part][:, STEADY][:, :, STEADY]
    return table
