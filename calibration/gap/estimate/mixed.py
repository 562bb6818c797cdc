"""Linear mixed-effects regression by normal equations: shared effects, and nuisances of each part.

    whitened residual of part f = X_f theta + Z_f b_f + white noise,   b_f ~ N(0, diag(spread^2))

The products of all columns are formed once per part (:class:`Products`); every fit, hold-out and bootstrap
after that is algebra of small matrices. Nuisances are integrated out, their spreads found by
expectation-maximisation (Laird, Ware, Biometrics 38, 1982).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from calibration.gap.estimate.nuisances import NUISANCES
from onboard.arrays import FloatArray

MOST = 0.5
"""Share of the information about an effect that one fold may have for the others to learn it without."""

_ROUNDS = 12
_LEAST = np.array([n.least for n in NUISANCES])
_MOST = np.array([n.most for n in NUISANCES])
FIRST_SPREAD: FloatArray = np.array([n.spread for n in NUISANCES])
"""Spreads of the nuisances to begin with."""


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
        spread: standard deviations of the nuisances, shape (q,).
        per_part: nuisances of each part, shape (parts, q).
        information: shape (parts, g, g); each part's share of the normal matrix, nuisances integrated out.
        score: shape (parts, g); its part of the right-hand side.
    """

    theta: FloatArray
    covariance: FloatArray
    spread: FloatArray
    per_part: FloatArray
    information: FloatArray
    score: FloatArray


def _without_nuisances(p: Products, spread: FloatArray) -> tuple[Any, ...]:
    precision = np.diag(spread**-2.0)
    inverse = np.linalg.inv(p.zz + precision)
    gain = np.einsum("fqp,fpg->fqg", inverse, p.zx)
    information = p.xx - np.einsum("fqg,fqh->fgh", p.zx, gain)
    score = p.xr - np.einsum("fqg,fq->fg", gain, p.zr)
    left = p.rr - np.einsum("fq,fqp,fp->f", p.zr, inverse, p.zr)
    volume = 0.5 * (np.sum(np.log(spread**-2.0)) + np.linalg.slogdet(inverse)[1])
    return inverse, information, score, left, volume


class Prior(NamedTuple):
    """What is believed of the shared effects before any flight: normal, each by itself.

    Attributes:
        mean: shape (g,).
        precision: shape (g,).
    """

    mean: FloatArray
    precision: FloatArray

    def of(self, columns: Sequence[int]) -> "Prior":
        """The same of some of the effects only."""
        return Prior(self.mean[list(columns)], self.precision[list(columns)])

    def and_of(self, others: "Prior") -> "Prior":
        """The same with others behind."""
        return Prior(*(np.concatenate(pair) for pair in zip(self, others, strict=True)))


def solve(information: FloatArray, score: FloatArray, prior: Prior) -> FloatArray:
    """theta, shape (g,), from summed normal equations."""
    matrix = information + np.diag(prior.precision)
    return np.asarray(np.linalg.solve(matrix, score + prior.precision * prior.mean))


def fit_mixed(
    p: Products, prior: Prior, spread: FloatArray = FIRST_SPREAD, rounds: int = _ROUNDS
) -> MixedFit:
    """Fit shared effects, nuisances and their spreads.

    Args:
        p: products of the columns.
        prior: of the shared effects.
        spread: standard deviations of the nuisances to begin with, shape (q,).
        rounds: of expectation-maximisation; 0 keeps the spreads.
    """
    for last in (*[False] * rounds, True):
        inverse, information, score, _, _ = _without_nuisances(p, spread)
        theta = solve(information.sum(axis=0), score.sum(axis=0), prior)
        per_part = np.einsum("fqp,fp->fq", inverse, p.zr - p.zx @ theta)
        if not last:
            square = per_part**2 + np.diagonal(inverse, axis1=1, axis2=2)
            spread = np.clip(np.sqrt(square.mean(axis=0)), _LEAST, _MOST)
    return MixedFit(
        theta=theta,
        covariance=np.linalg.inv(information.sum(axis=0) + np.diag(prior.precision)),
        spread=spread,
        per_part=per_part,
        information=information,
        score=score,
    )


def held_out_likelihood(p: Products, fit: MixedFit, prior: Prior, folds: np.ndarray) -> FloatArray:
    """Marginal log-likelihood of each part with the shared effects fitted on the other folds.

    An effect that one fold tells most of keeps its value there: what the others make of it, in a straight
    line from nothing, would only leave the likelihood of every other effect to chance.

    Args:
        p: products.
        fit: of all parts (its spreads are kept).
        prior: as for :func:`fit_mixed`.
        folds: fold of each part, shape (parts,).
    """
    result = np.empty(folds.size)
    _, information, score, left, volume = _without_nuisances(p, fit.spread)
    for fold in np.unique(folds):
        out = folds == fold
        theta = _fitted_elsewhere(fit, information, score, prior, out)
        quadratic = left - 2.0 * score @ theta + np.einsum("g,fgh,h->f", theta, information, theta)
        result[out] = (p.constant + volume - 0.5 * quadratic)[out]
    return result


def _fitted_elsewhere(
    fit: MixedFit, information: FloatArray, score: FloatArray, prior: Prior, out: np.ndarray
) -> FloatArray:
    """theta from the parts that are not `out`, but for what those that are tell most of."""
    told = np.einsum("fgg->fg", information)
    kept = told[out].sum(axis=0) > MOST * told.sum(axis=0)
    matrix = information[~out].sum(axis=0) + np.diag(prior.precision)
    right = score[~out].sum(axis=0) + prior.precision * prior.mean
    theta = fit.theta.copy()
    free = ~kept
    rest = right[free] - matrix[np.ix_(free, kept)] @ theta[kept]
    theta[free] = np.linalg.solve(matrix[np.ix_(free, free)], rest)
    return theta


def bootstrap_theta(
    fit: MixedFit, prior: Prior, clusters: np.ndarray, rng: np.random.Generator, repeats: int = 400
) -> FloatArray:
    """theta with clusters of parts drawn anew, shape (repeats, g): what an honest interval rests on.

    Args:
        fit: of all parts.
        prior: as for :func:`fit_mixed`.
        clusters: cluster of each part, 0 .. n-1, shape (parts,).
        rng: source of the draws.
        repeats: number of draws.
    """
    count = int(clusters.max()) + 1
    drawn = rng.multinomial(count, np.full(count, 1.0 / count), size=repeats).astype(float)
    weights = drawn[:, clusters]
    information = np.einsum("rf,fgh->rgh", weights, fit.information) + np.diag(prior.precision)
    score = weights @ fit.score + prior.precision * prior.mean
    return np.asarray(np.linalg.solve(information, score[:, :, None])[:, :, 0])
