"""Linear mixed-effects regression by normal equations: shared effects, and nuisances of each part.

    whitened residual of part f = X_f theta + Z_f b_f + white noise,   b_f ~ N(u, diag(spread^2))

where u is 0 but for what a flight has as a whole (:data:`~calibration.gap.estimate.nuisances.STEADY`), which
is drawn once for its parts. The products of all columns are formed once per part (:class:`Products`); every
fit, hold-out and bootstrap after that is algebra of small matrices. Nuisances are integrated out, and their
spreads found by maximum likelihood (:mod:`calibration.gap.estimate.spreads`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.nuisances import NUISANCES, SPREADS, STEADY
from calibration.gap.estimate.spreads import Scoring
from onboard.arrays import FloatArray

MOST = 0.5
"""Share of the information about an effect that one fold may have for the others to learn it without."""

_OWN = len(NUISANCES)
FIRST_SPREAD: FloatArray = np.array([s.first for s in SPREADS])
"""Spreads to begin with: of the nuisances of parts, then of those that flights have as a whole."""


@dataclass(frozen=True)
class Products:
    """Sums of products of whitened columns, per part of a flight.

    Attributes:
        zz: nuisance by nuisance, shape (parts, q, q).
        zx: nuisance by effect, shape (parts, q, g).
        xx: shape (parts, g, g).
        zr, xr: with the residual, shapes (parts, q) and (parts, g).
        rr: shape (parts,).
        constant: what the noise adds to the log-likelihood of each part, shape (parts,).
    """

    zz: FloatArray
    zx: FloatArray
    xx: FloatArray
    zr: FloatArray
    xr: FloatArray
    rr: FloatArray
    constant: FloatArray

    def __add__(self, other: "Products") -> "Products":
        """Those of both sets of rows."""
        return Products(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))

    def of(self, columns: Sequence[int]) -> "Products":
        """The same with some of the effect columns only."""
        index = np.asarray(columns, dtype=np.intp)
        return Products(
            self.zz,
            self.zx[:, :, index],
            self.xx[:, index][:, :, index],
            self.zr,
            self.xr[:, index],
            self.rr,
            self.constant,
        )


@dataclass(frozen=True)
class MixedFit:
    """Result of a fit.

    Attributes:
        theta: shared effects, shape (g,).
        covariance: of theta by the model, shape (g, g).
        spread: standard deviations of the nuisances over parts, then over flights; as :data:`FIRST_SPREAD`.
        per_part: nuisances of each part, shape (parts, q).
        information: shape (parts, g, g); each part's share of the normal matrix, nuisances integrated out.
        score: shape (parts, g); its part of the right-hand side.
        settled: whether the spreads are the most likely ones, not where the search for them was given up.
    """

    theta: FloatArray
    covariance: FloatArray
    spread: FloatArray
    per_part: FloatArray
    information: FloatArray
    score: FloatArray
    settled: bool = True


class _Marginal(NamedTuple):
    """The normal equations of each part with the nuisances integrated out.

    Attributes:
        inverse: covariance of a part's own nuisances, shape (parts, q, q).
        steady: nuisance by those that a flight has as a whole, shape (parts, q, m).
        level, level_by_effect: of these, where theta is 0, and per theta, shapes (parts, m), (parts, m, g);
            the same for the parts of one flight.
        level_covariance: shape (parts, m, m).
        information, score, left, volume: shapes (parts, g, g), (parts, g), (parts,), (parts,); summed over a
            flight they are exact, and each part's share of them is what it tells about the flight's level.
    """

    inverse: FloatArray
    steady: FloatArray
    level: FloatArray
    level_by_effect: FloatArray
    level_covariance: FloatArray
    information: FloatArray
    score: FloatArray
    left: FloatArray
    volume: FloatArray


def _without_nuisances(p: Products, spread: FloatArray) -> _Marginal:
    precision, believed = np.diag(spread[:_OWN] ** -2.0), np.diag(spread[_OWN:] ** -2.0)
    inverse = _inverse(p.zz + precision)
    steady = p.zz[:, :, STEADY]
    across = _transposed(steady)
    # What a part tells of theta, and of the flight's level.
    xx = p.xx - _transposed(p.zx) @ inverse @ p.zx
    xr = p.xr - _times(_transposed(p.zx), _times(inverse, p.zr))
    rr = p.rr - np.sum(p.zr * _times(inverse, p.zr), axis=1)
    ux = p.zx[:, STEADY] - across @ inverse @ p.zx
    uu = steady[:, STEADY] - across @ inverse @ steady
    ur = p.zr[:, STEADY] - _times(across, _times(inverse, p.zr))
    covariance = _inverse(_of_flights(uu) + believed)
    by_effect, level = covariance @ _of_flights(ux), _times(covariance, _of_flights(ur))
    by_effect, level, covariance = (np.repeat(each, PARTS, axis=0) for each in (by_effect, level, covariance))
    # Each part less its flight's level; the level itself, which is believed to be small, in equal shares.
    ours, shared = _transposed(by_effect), uu + believed / PARTS
    mixed = _transposed(ux) @ by_effect
    own_volume = np.sum(np.log(spread[:_OWN] ** -2.0)) + np.linalg.slogdet(inverse)[1]
    level_volume = np.sum(np.log(spread[_OWN:] ** -2.0)) + np.linalg.slogdet(covariance)[1]
    return _Marginal(
        inverse=inverse,
        steady=steady,
        level=level,
        level_by_effect=by_effect,
        level_covariance=covariance,
        information=xx - mixed - _transposed(mixed) + ours @ shared @ by_effect,
        score=xr - _times(_transposed(ux), level) - _times(ours, ur - _times(shared, level)),
        left=rr - 2.0 * np.sum(ur * level, axis=1) + np.sum(level * _times(shared, level), axis=1),
        volume=0.5 * (own_volume + level_volume / PARTS),
    )


def _inverse(matrices: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(matrices), dtype=np.float64)


def _transposed(matrices: FloatArray) -> FloatArray:
    return np.swapaxes(matrices, 1, 2)


def _times(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def _of_flights(by_part: FloatArray) -> FloatArray:
    """Sums over the parts of each flight."""
    flights = by_part.shape[0] // PARTS
    return np.asarray(by_part.reshape(flights, PARTS, *by_part.shape[1:]).sum(axis=1))


class Prior(NamedTuple):
    """What is believed of the shared effects before any flight: normal.

    Attributes:
        mean: shape (g,).
        precision: shape (g, g).
    """

    mean: FloatArray
    precision: FloatArray

    @classmethod
    def independent(cls, mean: FloatArray, precision: FloatArray) -> "Prior":
        """Of effects each by itself; `precision` of each, shape (g,)."""
        return cls(mean, np.diag(precision))

    def of(self, columns: Sequence[int]) -> "Prior":
        """The same of some of the effects only."""
        return Prior(self.mean[list(columns)], self.precision[np.ix_(columns, columns)])

    def and_of(self, others: "Prior") -> "Prior":
        """The same with others behind."""
        return Prior(
            np.concatenate([self.mean, others.mean]),
            np.asarray(block_diag(self.precision, others.precision)),
        )

    def tied(self, weights: FloatArray, sum_of: float, sigma: float) -> "Prior":
        """The same, and the weighted sum of the effects is `sum_of`, give or take `sigma`."""
        precision = self.precision + np.outer(weights, weights) * sigma**-2.0
        pull = self.precision @ self.mean + weights * sum_of * sigma**-2.0
        return Prior(np.asarray(np.linalg.solve(precision, pull)), precision)


def solve(information: FloatArray, score: FloatArray, prior: Prior) -> FloatArray:
    """theta, shape (g,), from summed normal equations."""
    matrix = information + prior.precision
    return np.asarray(np.linalg.solve(matrix, score + prior.precision @ prior.mean))


def fit_mixed(
    p: Products, prior: Prior, spread: FloatArray = FIRST_SPREAD, keep_spread: bool = False
) -> MixedFit:
    """Fit shared effects, nuisances and their spreads.

    Args:
        prior: of the shared effects.
        spread: standard deviations of the nuisances to begin with; `keep_spread`: and to end with.
    """
    scoring = Scoring(p.zz, spread)
    while True:
        marginal = _without_nuisances(p, scoring.spread)
        theta = solve(marginal.information.sum(axis=0), marginal.score.sum(axis=0), prior)
        level = marginal.level - marginal.level_by_effect @ theta
        per_part = _times(marginal.inverse, p.zr - p.zx @ theta - _times(marginal.steady, level))
        if keep_spread or scoring.settled or scoring.exhausted:
            break
        scoring.step(_squares(marginal, per_part, level))
    per_part[:, STEADY] += level
    return MixedFit(
        theta=theta,
        covariance=np.linalg.inv(marginal.information.sum(axis=0) + prior.precision),
        spread=scoring.spread,
        per_part=per_part,
        information=marginal.information,
        score=marginal.score,
        settled=keep_spread or scoring.settled,
    )


def _squares(marginal: _Marginal, own: FloatArray, level: FloatArray) -> FloatArray:
    """Expected squares of the nuisances: of parts about their flight, then of flights about their mean.

    A mean that all flights share is no scatter between them. Were it counted as such, a weight that is wrong
    in all of them would cost next to nothing.
    """
    moved = marginal.inverse @ marginal.steady
    doubt = marginal.inverse + moved @ marginal.level_covariance @ _transposed(moved)
    squares = (own**2 + np.diagonal(doubt, axis1=1, axis2=2)).mean(axis=0)
    flights = level.shape[0] // PARTS
    scatter = level.var(axis=0) * flights / (flights - 1) if flights > 1 else (level**2).mean(axis=0)
    of_flights = scatter + np.diagonal(marginal.level_covariance, axis1=1, axis2=2).mean(axis=0)
    return np.concatenate([squares, of_flights])


def held_out_likelihood(p: Products, fit: MixedFit, prior: Prior, folds: np.ndarray) -> FloatArray:
    """Marginal log-likelihood of each part with the shared effects fitted on the other folds.

    An effect that one fold tells most of keeps its value there: what the others make of it, in a straight
    line from nothing, would only leave the likelihood of every other effect to chance.

    Args:
        fit: of all parts (its spreads are kept).
        folds: fold of each part, shape (parts,).
    """
    return held_out_shares(p, (p,), fit, prior, folds)[0]


def held_out_shares(
    p: Products, shares: Sequence[Products], fit: MixedFit, prior: Prior, folds: np.ndarray
) -> FloatArray:
    """What each of some kinds of signals has of :func:`held_out_likelihood`, shape (kinds, parts).

    Args:
        p: products of all signals, to which the effects are fitted.
        shares: products of the signals of each kind, none of which has a nuisance in common with another.
        fit, prior, folds: as there.
    """
    whole = _without_nuisances(p, fit.spread)
    kinds = [(one, _without_nuisances(one, fit.spread)) for one in shares]
    result = np.empty((len(kinds), folds.size))
    for fold in np.unique(folds):
        out = folds == fold
        theta = _fitted_elsewhere(fit, whole.information, whole.score, prior, out)
        for kind, (one, told) in enumerate(kinds):
            quadratic = np.einsum("g,fgh,h->f", theta, told.information, theta)
            quadratic += told.left - 2.0 * told.score @ theta
            result[kind, out] = (one.constant + told.volume - 0.5 * quadratic)[out]
    return result


def _fitted_elsewhere(
    fit: MixedFit, information: FloatArray, score: FloatArray, prior: Prior, out: np.ndarray
) -> FloatArray:
    """theta from the parts that are not `out`, but for what those that are tell most of."""
    told = np.einsum("fgg->fg", information)
    kept = told[out].sum(axis=0) > MOST * told.sum(axis=0)
    matrix = information[~out].sum(axis=0) + prior.precision
    right = score[~out].sum(axis=0) + prior.precision @ prior.mean
    theta = fit.theta.copy()
    free = ~kept
    rest = right[free] - matrix[np.ix_(free, kept)] @ theta[kept]
    theta[free] = np.linalg.solve(matrix[np.ix_(free, free)], rest)
    return theta


def jackknife_errors(fit: MixedFit, prior: Prior, clusters: np.ndarray) -> FloatArray:
    """Standard error of each shared effect by leaving out one cluster of parts after the other, shape (g,).

    Nothing is assumed of what the parts of a cluster have in common (CV3: MacKinnon, Nielsen, Webb, Journal
    of Econometrics 232, 2023). A bootstrap over few clusters gives less, as it forgets how much each one
    bent the fit towards itself.

    Args:
        fit: of all parts; its spreads are kept.
        clusters: cluster of each part, 0 .. n-1, shape (parts,).
    """
    count = int(clusters.max()) + 1
    left_out = (np.arange(count)[:, None] != clusters).astype(float)
    information = np.einsum("rf,fgh->rgh", left_out, fit.information) + prior.precision
    score = left_out @ fit.score + prior.precision @ prior.mean
    moved = _times(_inverse(information), score) - fit.theta
    return np.asarray(np.sqrt((count - 1) / count * (moved**2).sum(axis=0)))
