"""A first look at every candidate: linearised, under the noise model of the present fit."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from calibration.gap.estimate.mixed import Prior, Products, fit_mixed, held_out_likelihood
from calibration.gap.estimate.model import Variable
from calibration.gap.estimate.nuisances import nuisance_columns
from calibration.gap.estimate.refine import Fitted, Training, prior_step
from calibration.gap.search.candidates import Candidate
from onboard.arrays import FloatArray


class Promise(NamedTuple):
    """What a candidate promises.

    Attributes:
        gain: in held-out log-likelihood.
        candidate: which.
        errors: standard error that each variable would have; empty where there is no derivative.
    """

    gain: float
    candidate: Candidate
    errors: dict[Variable, float]


def screen(present: Fitted, offered: Sequence[Candidate], training: Training) -> list[Promise]:
    """What each candidate promises, the best first.

    Those with a derivative at the present model are judged by one linear fit each, out of one table of
    products; the others by the best of their starting models.
    """
    linear = [c for c in offered if c.starts[0] is present.model]
    others = [c for c in offered if c.starts[0] is not present.model]
    found = [*_linear_gains(present, linear, training), *_best_starts(present, others, training)]
    return sorted(found, key=lambda promise: (-promise.gain, promise.candidate.effect))


def products_with(present: Fitted, variables: Sequence[Variable], training: Training) -> Products:
    """Products of the columns of a fit and, behind them, of the responses to some variables."""
    responses = [present.model.response(training.records, v, present.predicted) for v in variables]
    regression, noise = training.regression, present.estimate.noise
    nuisances = nuisance_columns(regression.signals, present.predicted)
    table = regression.whitened([*nuisances, *present.columns, *responses], noise)
    return regression.products(table, regression.misfit(present.predicted), len(nuisances), noise)


def _linear_gains(present: Fitted, offered: Sequence[Candidate], training: Training) -> list[Promise]:
    variables = [variable for candidate in offered for variable in candidate.variables]
    products = products_with(present, variables, training)
    prior = present.prior.and_of(prior_step(present.model, variables))
    spread = present.estimate.fit.spread
    base = list(range(len(present.columns)))
    found, first = [], len(base)
    reference = held_out(products.of(base), prior.of(base), spread, training)
    for candidate in offered:
        chosen = [*base, *range(first, first + len(candidate.variables))]
        first += len(candidate.variables)
        scores = held_out(products.of(chosen), prior.of(chosen), spread, training)
        covariance = fit_mixed(products.of(chosen), prior.of(chosen), spread, keep_spread=True).covariance
        errors = np.sqrt(np.diag(covariance))[len(base) :]
        found.append(
            Promise(
                float(np.max(scores - reference)),
                candidate,
                dict(zip(candidate.variables, errors.tolist(), strict=True)),
            )
        )
    return found


def _best_starts(present: Fitted, offered: Sequence[Candidate], training: Training) -> list[Promise]:
    """Each candidate with its best starting model alone, and what that promises."""
    regression, noise = training.regression, present.estimate.noise
    prior, spread = present.prior, present.estimate.fit.spread
    nuisances = nuisance_columns(regression.signals, present.predicted)
    table = regression.whitened([*nuisances, *present.columns], noise)

    def likelihood(predicted: FloatArray) -> float:
        products = regression.products(table, regression.misfit(predicted), len(nuisances), noise)
        return float(held_out(products, prior, spread, training)[1])

    reference = likelihood(present.predicted)
    found = []
    for candidate in offered:
        gains = [likelihood(start.predict(training.records)) - reference for start in candidate.starts]
        best = int(np.argmax(gains))
        found.append(Promise(gains[best], candidate._replace(starts=(candidate.starts[best],)), {}))
    return found


def held_out(products: Products, prior: Prior, spread: FloatArray, training: Training) -> FloatArray:
    """Held-out log-likelihood by shapes and by parts, shape (2,)."""
    fit = fit_mixed(products, prior, spread)
    return np.array(
        [
            held_out_likelihood(products, fit, prior, split).sum()
            for split in (training.by_shape, training.by_time)
        ]
    )
