"""Blocks of time: their mean residual is what a profile must explain, their signs are what chance draws."""

import math
from dataclasses import dataclass

import numpy as np

from calibration.gap.data.signals import Signals
from onboard.arrays import BoolArray, FloatArray

BLOCK = 0.25
"""s: long against the noise of the sensors, short against a crossing of the room."""

_FILLED = 0.6
"""Share of a block's rows that must be valid."""


@dataclass(frozen=True)
class Blocks:
    """Rows by block; none crosses the border of a flight's part.

    Attributes:
        of_row: block of each row, shape (n,).
        part: of each block, shape (blocks,).
        length: rows of a full block.
    """

    of_row: np.ndarray
    part: np.ndarray
    length: int

    def full(self, valid: BoolArray) -> BoolArray:
        """Blocks with enough valid rows, shape (blocks,); `valid` has shape (n,)."""
        counts = np.bincount(self.of_row[valid], minlength=self.part.size)
        return np.asarray(counts >= _FILLED * self.length)


def make_blocks(signals: Signals) -> Blocks:
    """Blocks of some flights."""
    length = max(1, round(BLOCK / signals.dt))
    within = (np.arange(signals.part.size) - signals.part_bounds[signals.part]) // length
    new = (np.diff(signals.part, prepend=-1) != 0) | (np.diff(within, prepend=-1) != 0)
    return Blocks(np.cumsum(new) - 1, signals.part[new], length)


def grouped_mean(values: FloatArray, group: np.ndarray, count: int) -> FloatArray:
    """Mean of rows by group, shape (count, ...); 0 for groups without rows."""
    flat = values.reshape(values.shape[0], math.prod(values.shape[1:]))
    sums = np.stack([np.bincount(group, column, count) for column in flat.T], axis=1)
    sizes = np.maximum(np.bincount(group, minlength=count), 1)
    return np.asarray((sums / sizes[:, None]).reshape(count, *values.shape[1:]))
