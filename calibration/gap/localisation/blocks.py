"""Spans of time: blocks whose mean residual is judged, and longer units that chance is drawn by."""

import math
from dataclasses import dataclass

import numpy as np

from calibration.gap.signals import Signals
from onboard.arrays import BoolArray, FloatArray

BLOCK = 0.25
"""s: long against the noise of the sensors, short against a crossing of the room."""

_PER_UNIT = 4
_FILLED = 0.6
"""Share of a block's rows that must be valid."""


@dataclass(frozen=True)
class Spans:
    """Rows by block and by unit; neither crosses the border of a flight's part.

    Attributes:
        block: of each row, shape (n,).
        unit: of each row, shape (n,): 1 s.
        unit_of_block: shape (blocks,).
        part_of_unit: shape (units,).
        length: rows of a full block.
    """

    block: np.ndarray
    unit: np.ndarray
    unit_of_block: np.ndarray
    part_of_unit: np.ndarray
    length: int

    def full_blocks(self, valid: BoolArray) -> BoolArray:
        """Blocks with enough valid rows, shape (blocks,); `valid` has shape (n,)."""
        counts = np.bincount(self.block[valid], minlength=self.unit_of_block.size)
        return np.asarray(counts >= _FILLED * self.length)


def make_spans(signals: Signals) -> Spans:
    """Blocks and units of some flights."""
    length = max(1, round(BLOCK / signals.dt))
    rows = np.arange(signals.part.size)
    within = (rows - signals.part_bounds[signals.part]) // length
    block, unit = _numbered(signals.part, within), _numbered(signals.part, within // _PER_UNIT)
    firsts = np.flatnonzero(np.diff(block, prepend=-1))
    unit_firsts = np.flatnonzero(np.diff(unit, prepend=-1))
    return Spans(block, unit, unit[firsts], signals.part[unit_firsts], length)


def _numbered(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Number of each run of equal (outer, inner), from 0."""
    new = (np.diff(outer, prepend=-1) != 0) | (np.diff(inner, prepend=-1) != 0)
    return np.asarray(np.cumsum(new) - 1)


def grouped_mean(values: FloatArray, group: np.ndarray, count: int) -> FloatArray:
    """Mean of rows by group, shape (count, ...); 0 for groups without rows."""
    flat = values.reshape(values.shape[0], math.prod(values.shape[1:]))
    sums = np.stack([np.bincount(group, column, count) for column in flat.T], axis=1)
    sizes = np.maximum(np.bincount(group, minlength=count), 1)
    return np.asarray((sums / sizes[:, None]).reshape(count, *values.shape[1:]))
