"""A first look at every candidate: linearised, under the noise model of the present fit."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from calibration.gap.candidates import Candidate
from calibration.gap.mixed import Products, fit_mixed, held_out_likelihood
from calibration.gap.model import WORKERS
from calibration.gap.nuisances import nuisance_columns
from calibration.gap.refine import Fitted, Training, refine, ridge
from onboard.arrays import FloatArray


def screen(
    present: Fitted, offered: Sequence[Candidate], training: Training
) -> list[tuple[float, Candidate]]:
    """Candidates with the gain in held-out log-likelihood that each promises, best first.

    Those with a derivative at the present model are judged by one linear fit each, out of one table of
    products; the others by the best of their starting models.
    """
    linear = [c for c in offered if c.starts[0] is present.model]
    gains = _linear_gains(present, linear, training)
    others = [c for c in offered if c.starts[0] is not present.model]
    with ThreadPoolExecutor(WORKERS) as pool:
        far = list(pool.map(lambda c: _best_start(present, c, training), others))
    return sorted([*gains, *far], key=lambda pair: (-pair[0], pair[1].effect))


def _linear_gains(
    present: Fitted, offered: Sequence[Candidate], training: Training
) -> list[tuple[float, Candidate]]:
    variables = [variable for candidate in offered for variable in candidate.variables]
    columns = [
        present.model.derivative(training.records, variable, present.predicted) for variable in variables
    ]
    regression, estimate = training.regression, present.estimate
    raw = np.where(regression.signals.valid, regression.signals.measured - present.predicted, 0.0)
    nuisances = nuisance_columns(regression.signals, present.predicted)
    products = regression.products(raw, [*present.columns, *columns], nuisances, estimate.noise)
    weak = np.concatenate([ridge(present.variables), ridge(variables)])
    base = list(range(len(present.columns)))
    found, first = [], len(base)
    reference = _held_out(products.of(base), weak[base], estimate.fit.spread, training)
    for candidate in offered:
        chosen = [*base, *range(first, first + len(candidate.variables))]
        first += len(candidate.variables)
        scores = _held_out(products.of(chosen), weak[chosen], estimate.fit.spread, training)
        found.append((float(np.max(scores - reference)), candidate))
    return found


def _held_out(products: Products, weak: FloatArray, spread: FloatArray, training: Training) -> FloatArray:
    """Held-out log-likelihood by shapes and by parts, shape (2,)."""
    fit = fit_mixed(products, weak, spread)
    return np.array(
        [
            held_out_likelihood(products, fit, weak, split).sum()
            for split in (training.by_shape, training.by_time)
        ]
    )


def _best_start(present: Fitted, candidate: Candidate, training: Training) -> tuple[float, Candidate]:
    """The candidate with its best starting model alone, and what that promises."""
    fits = [
        refine(start, present.variables, training, iterations=1, start=present.estimate)
        for start in candidate.starts
    ]
    gains = [float(fit.gains(present, concentrated=True).sum()) for fit in fits]
    best = int(np.argmax(gains))
    return gains[best], candidate._replace(starts=(candidate.starts[best],))
