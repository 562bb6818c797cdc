"""Paths over time as values at knots, linear between them."""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import BSpline

from onboard.arrays import FloatArray


def knots_over(t: FloatArray, spacing: float) -> FloatArray:
    """Evenly spaced knots (s) from the first to the last of `t`, about `spacing` s apart."""
    return np.linspace(t[0], t[-1], max(round((t[-1] - t[0]) / spacing), 1) + 1)


def cells(t: FloatArray, knots: FloatArray) -> NDArray[np.int64]:
    """For each of `t` the index of the knot before it, shape as `t`."""
    return np.clip(np.searchsorted(knots, t, side="right") - 1, 0, knots.size - 2)


def hats(t: FloatArray, knots: FloatArray) -> sparse.csr_matrix:
    """Linear interpolation from `knots` to `t` as a matrix, shape (n, k)."""
    return sparse.csr_matrix(BSpline.design_matrix(t, np.r_[knots[0], knots, knots[-1]], 1))


def block_means(rows: NDArray[np.int64], length: int) -> sparse.csr_matrix:
    """Means over blocks of `length` samples as a matrix, shape (blocks, n); `rows` numbers the samples."""
    _, block = np.unique(rows // length, return_inverse=True)
    share = 1.0 / np.bincount(block)[block]
    return sparse.csr_matrix((share, (block, np.arange(rows.size))))
