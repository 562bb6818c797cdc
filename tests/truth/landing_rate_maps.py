"""Drawn maps of the landing rate, as truth for campaigns: none is of the family of their surrogate.

Each shape takes coordinates (n,) from 0 to 1 along speed and angle, and gives rates (n,).
"""

from collections.abc import Callable

import numpy as np

from onboard.arrays import FloatArray
from perchhw.campaign.adaptive import choose
from perchhw.campaign.plan import Condition
from perchhw.campaign.rate_map import ExpectedRates, RateSurrogate

Shape = Callable[[FloatArray, FloatArray, np.random.Generator], FloatArray]

LEAST_CONTRAST = 0.3
"""Between the highest and the lowest rate of a map; a flatter one is drawn anew."""


def cliff(x: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Two plateaus with a sudden step between them along a line."""
    direction = rng.uniform(0.0, 2.0 * np.pi)
    side = (x - rng.uniform(0.3, 0.7)) * np.cos(direction) + (y - rng.uniform(0.3, 0.7)) * np.sin(direction)
    return np.where(side > 0.0, rng.uniform(0.8, 1.0), rng.uniform(0.0, 0.15))


def island(x: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A superellipse where landing works, with a linear shore."""
    wide, high = rng.uniform(0.25, 0.5, 2)
    reach = np.abs((x - rng.uniform(0.3, 0.7)) / wide) ** 3 + np.abs((y - rng.uniform(0.3, 0.7)) / high) ** 3
    return rng.uniform(0.8, 1.0) * np.clip(1.5 - reach, 0.0, 1.0)


def facets(x: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
    """The middle one of three planes, cut off at 0 and 1."""
    planes = [rng.uniform(-0.5, 1.2) + rng.uniform(-1.5, 1.5) * x + rng.uniform(-1.5, 1.5) * y for _ in "abc"]
    return np.clip(np.sort(np.stack(planes), axis=0)[1], 0.0, 1.0)


def band(x: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A curved band of landings, as between too early and too late a flip."""
    centre = rng.uniform(0.2, 0.5) + rng.uniform(0.1, 0.6) * x**2
    return rng.uniform(0.75, 1.0) * np.clip(1.6 - np.abs(y - centre) / rng.uniform(0.15, 0.3), 0.0, 1.0)


def ramp(x: FloatArray, y: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A rate that rises evenly across the grid: no place tells more than another."""
    share = rng.uniform(0.0, 1.0)
    return 0.05 + 0.9 * (share * x + (1.0 - share) * y)


SHAPES: dict[str, Shape] = {shape.__name__: shape for shape in (cliff, island, facets, band, ramp)}


class KnownMap:
    """One truth over a grid, and what attempts at its conditions give.

    Args:
        rate: (n,) landing rates.
        conditions: n of them.
        rng: of the attempts.
        most: attempts at a condition.

    Attributes:
        rate: as given.
        surrogate: what makes maps of its attempts.
    """

    def __init__(
        self, rate: FloatArray, conditions: list[Condition], rng: np.random.Generator, most: int
    ) -> None:
        self._rng, self.rate = rng, rate
        # The n-th attempt at a condition ends alike, whichever campaign flies it.
        self._lands = self._rng.random((len(conditions), most)) < self.rate[:, None]
        self.surrogate = RateSurrogate(conditions)

    def landed(self, flown: FloatArray) -> FloatArray:
        """Landings after as many attempts at each condition."""
        return np.array([self._lands[i, : int(n)].sum() for i, n in enumerate(flown)], dtype=float)

    def known(self, flown: FloatArray) -> ExpectedRates:
        """The surrogate's map after them."""
        return self.surrogate.fit(self.landed(flown), flown)

    def error(self, rate: FloatArray) -> float:
        """Mean square error of a map."""
        return float(np.mean((rate - self.rate) ** 2))

    def grid(self, repeats: int) -> FloatArray:
        """Attempts of a grid."""
        return np.full(self.rate.size, float(repeats))

    def shuffled(self, repeats: int, attempts: int) -> FloatArray:
        """The first `attempts` of a shuffled grid."""
        order = self._rng.permutation(np.repeat(np.arange(self.rate.size), repeats))[:attempts]
        return np.bincount(order, minlength=self.rate.size).astype(float)

    def chosen(self, attempts: int) -> list[FloatArray]:
        """Attempts of an adaptive campaign after each of its choices."""
        flown = self.grid(0)
        steps = []
        for _ in range(attempts):
            flown = flown.copy()
            flown[choose(self.known(flown), self._rng)] += 1.0
            steps.append(flown)
        return steps


class DrawnMap(KnownMap):
    """One of a shape."""

    def __init__(self, shape: str, conditions: list[Condition], seed: int, most: int) -> None:
        rng = np.random.default_rng([seed, list(SHAPES).index(shape)])
        places = np.array(conditions)
        unit = (places - places.min(axis=0)) / np.ptp(places, axis=0)
        rate = np.zeros(len(conditions))
        while np.ptp(rate) < LEAST_CONTRAST:
            rate = SHAPES[shape](unit[:, 0], unit[:, 1], rng)
        super().__init__(rate, conditions, rng, most)
