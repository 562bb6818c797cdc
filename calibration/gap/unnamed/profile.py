"""Piecewise-linear profiles of a residual over regressors, cross-validated, for many draws of chance."""

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from calibration.gap.data.signals import PARTS, Signals
from calibration.gap.data.split import FEW
from calibration.gap.unnamed.normal_equations import NormalEquations
from onboard.arrays import FloatArray

KNOTS = 12
"""Of each profile."""

_FOLDS = 5
_MEMORY = 0.3
"""s: how long a push is felt before the vehicle has moved; long against it is what flights command."""
_RIDGE = 1e-3
"""Share of the mean information of a knot: one that has much less is drawn towards zero."""


class Explained(NamedTuple):
    """What profiles explain that were fitted elsewhere, each of shape (c, r, draws).

    Attributes:
        gain: of the squared innovations, in units of their variance.
        share: of the variance of block means.
    """

    gain: FloatArray
    share: FloatArray


def profile_knots(values: FloatArray) -> FloatArray:
    """Knots of the profile over a regressor, increasing, shape (12,).

    Between equal widths and equal times: neither stretches without data nor twelve knots about the hover.
    """
    known = np.sort(values[np.isfinite(values)])
    low, high = np.quantile(known, [0.005, 0.995])
    spread = np.linspace(low, high, 1001)
    often = np.quantile(known, np.linspace(0.005, 0.995, 501))
    return np.asarray(np.quantile(np.concatenate([spread, often]), np.linspace(0.0, 1.0, KNOTS)))


def places(values: FloatArray, knots: FloatArray) -> FloatArray:
    """Place of each value among the knots, 0 .. 11, shape (n,); -1 where it is not known."""
    at = np.interp(values, knots, np.arange(float(knots.size)))
    return np.where(np.isfinite(values), at, -1.0)


def fast_part(values: FloatArray, signals: Signals) -> FloatArray:
    """What a regressor did lately: its distance from its mean over the last moments, scaled, shape (n,)."""
    known, part = np.where(np.isfinite(values), values, 0.0), np.zeros(values.size)
    keep = np.exp(-signals.dt / _MEMORY)
    for rows in map(signals.rows, range(signals.flights)):
        mean, _ = lfilter([1.0 - keep], [1.0, -keep], known[rows], zi=[keep * known[rows.start]])
        part[rows] = known[rows] - mean
    size = part.std()
    return part / size if size > 0.0 else part


def few_visit(matrix: FloatArray) -> np.ndarray:
    """Whether some knot of a regressor is known from fewer than four flights, shape (r,).

    Args:
        matrix: of :class:`NormalEquations`, by part.
    """
    by_part = np.einsum("pcrkk->prk", matrix[..., :KNOTS, :KNOTS])
    diagonal = by_part.reshape(-1, PARTS, *by_part.shape[1:]).sum(axis=1)
    total = diagonal.sum(axis=0)
    share = diagonal / np.where(total > 0.0, total, 1.0)
    return np.asarray(((share**2).sum(axis=0) > 1.0 / FEW).any(axis=1))


def random_signs(blocks: int, draws: int, rng: np.random.Generator) -> FloatArray:
    """Signs of the blocks, shape (blocks, 1 + draws): as they are, then turned at random."""
    signs = rng.choice((-1.0, 1.0), size=(blocks, 1 + draws))
    signs[:, 0] = 1.0
    return signs


def explained(whitened: NormalEquations, blocks: NormalEquations, signs: FloatArray) -> Explained:
    """What profiles explain on flights (or parts of them, where few tell) that they were not fitted to.

    Args:
        whitened: that profiles are fitted to.
        blocks: of the same channels and regressors.
        signs: of the blocks, shape (blocks, draws).
    """
    parts = np.arange(whitened.matrix.shape[0])
    flight = parts // PARTS
    in_parts = few_visit(whitened.matrix)
    shape = (*whitened.score.shape[1:3], signs.shape[1])
    found = Explained(np.zeros(shape), np.zeros(shape))
    for chosen, folds in ((in_parts, (parts + flight) % PARTS), (~in_parts, flight % _FOLDS)):
        if chosen.any():
            pair = _cross_validated(_of(whitened, chosen), _of(blocks, chosen), signs, folds)
            for table, values in zip(found, pair, strict=True):
                table[:, chosen] = values
    return found


def _cross_validated(
    whitened: NormalEquations, blocks: NormalEquations, signs: FloatArray, folds: np.ndarray
) -> Explained:
    names = np.unique(folds)
    matrix, score = _by_fold(whitened, signs, folds, names)
    fast = slice(KNOTS, None)
    fitted = _fit_elsewhere(matrix, score)
    alone = matrix[..., fast, fast], score[..., fast, :]
    gain = _reduction(fitted, matrix, score) - _reduction(_fit_elsewhere(*alone), *alone)
    share = _reduction(fitted[..., :KNOTS, :], *_by_fold(blocks, signs, folds, names))
    return Explained(_over(gain, whitened.total), _over(share, blocks.total))


def _fit_elsewhere(matrix: FloatArray, score: FloatArray) -> FloatArray:
    """Coefficients fitted on the other folds, shape of `score`."""
    whole = matrix.sum(axis=0)
    # In proportion to the whole: where one fold has it all, the rest is rounding and must stay small.
    return np.asarray(np.linalg.solve(whole - matrix + _ridge(whole), score.sum(axis=0) - score))


def _reduction(fitted: FloatArray, matrix: FloatArray, score: FloatArray) -> FloatArray:
    """Squares that coefficients take away from each fold, summed, shape (c, r, draws)."""
    return np.asarray((2.0 * fitted * score - fitted * (matrix @ fitted)).sum(axis=(0, 3)))


def _by_fold(
    equations: NormalEquations, signs: FloatArray, folds: np.ndarray, names: np.ndarray
) -> tuple[FloatArray, FloatArray]:
    """Matrices (folds, c, r, k, k) and scores (folds, c, r, k, draws)."""
    matrix = np.stack([equations.matrix[folds == name].sum(axis=0) for name in names])
    score = []
    for name in names:
        rows = np.flatnonzero(folds[equations.part] == name)
        flat = equations.score[rows].reshape(rows.size, -1).T @ signs[rows]
        score.append(flat.reshape(*equations.score.shape[1:], signs.shape[1]))
    return matrix, np.stack(score)


def fit_profile(equations: NormalEquations, channel: int, regressor: int) -> tuple[FloatArray, FloatArray]:
    """Profile of one channel over the knots of one regressor, and its standard errors by part, shape (k,).

    Zero on average over time; the covariance is that of clustered scores (Liang, Zeger, Biometrika 73, 1986).
    """
    matrix = equations.matrix[:, channel, regressor]
    parts = matrix.shape[0]
    score = np.stack(
        [np.bincount(equations.part, s, parts) for s in equations.score[:, channel, regressor].T]
    )
    whole = matrix.sum(axis=0)
    inverse = np.linalg.inv(whole + _ridge(whole))
    theta = inverse @ score.sum(axis=1)
    left = score - (matrix @ theta).T
    errors = np.sqrt(np.diag(inverse @ (left @ left.T) @ inverse))
    return theta[:KNOTS], errors[:KNOTS]


def _ridge(matrix: FloatArray) -> FloatArray:
    knots = matrix.shape[-1]
    mean = np.trace(matrix, axis1=-2, axis2=-1)[..., None, None] / knots
    return np.asarray((_RIDGE * mean + 1e-300) * np.eye(knots))


def _over(explained_squares: FloatArray, total: FloatArray) -> FloatArray:
    return explained_squares / np.where(total > 0.0, total, np.inf)[:, None, None]


def _of(equations: NormalEquations, chosen: np.ndarray) -> NormalEquations:
    return NormalEquations(
        equations.score[:, :, chosen], equations.matrix[:, :, chosen], equations.total, equations.part
    )
