"""Terms without a name as curves of a vehicle file: those that are functions of the flight's state."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from calibration.gap.data.channels import ResidualChannel
from calibration.gap.estimate.refine import Fitted
from calibration.gap.unnamed.fitted_terms import coefficients
from calibration.gap.unnamed.terms import CurveTerm, IntervalTerm, PolynomialTerm
from onboard.arrays import FloatArray
from onboard.vehicle.unnamed import MOST_KNOTS, REGRESSORS, UnnamedCurve

OWN_PHASE = "has a phase of its own in each flight, which the next one does not know"
NO_STATE = "{} is no state of the simulated flight"

_FLOWN = (0.005, 0.995)
"""Quantiles of a regressor between which the flights tell of it."""

_RAMP = 0.005
"""Share of the flown range over which a force comes and goes at the end of its region, to either side: the
ends are not better known."""


class WordedTerm(NamedTuple):
    """A term of a fit: what it is in words, its curve, and why it has none (empty where it has one)."""

    formula: str
    curve: UnnamedCurve | None
    why_not: str


def worded_terms(fitted: Fitted, parameters: Any, source: str) -> Iterator[WordedTerm]:
    """Every term without a name of a fit, in the order in which they were found.

    Args:
        fitted: the fit.
        parameters: record of the physics of the vehicle that gets the curves: its mass and inertia make
            forces and torques of what the flights show, which are accelerations.
        source: provenance of the numbers, for the file.
    """
    covariance = fitted.estimate.fit.covariance
    first = len(fitted.variables)
    for term, values in coefficients(fitted):
        columns = slice(first, first + values.size)
        first = columns.stop
        formula = term.formula(values, fitted.model.base)
        if not isinstance(term, IntervalTerm | PolynomialTerm | CurveTerm):
            yield WordedTerm(formula, None, OWN_PHASE)
        elif term.regressor not in REGRESSORS:
            yield WordedTerm(formula, None, NO_STATE.format(term.quantity.symbol))
        else:
            knots, shapes = _shapes(term)
            scale = _scale(term.channel, parameters)
            variance = np.einsum("ki,ij,kj->k", shapes, covariance[columns, columns], shapes)
            curve = UnnamedCurve(
                channel=term.channel.name,
                regressor=term.regressor,
                knots=tuple(knots.tolist()),
                values=tuple((scale * (shapes @ values)).tolist()),
                sigma=scale * float(np.sqrt(variance.max())),
                source=f"{source}; without a name: {formula}",
            )
            yield WordedTerm(formula, curve, "")


def _scale(channel: ResidualChannel, parameters: Any) -> float:
    """Force (N) or torque (N m) per acceleration."""
    return float(parameters["mass"] if channel.kind == "force" else parameters["inertia"][channel.axis])


def _shapes(term: IntervalTerm | PolynomialTerm | CurveTerm) -> tuple[FloatArray, FloatArray]:
    """Knots, shape (k,), and the columns of a term at them, shape (k, values)."""
    if isinstance(term, CurveTerm):
        return term.knots, term.at_knots(np.eye(term.knots.size - 1))
    low, high = np.nanquantile(term.quantity.values, _FLOWN).tolist()
    if isinstance(term, IntervalTerm):
        return _of_interval(term, _RAMP * (high - low))
    degree = len(term.columns)
    knots = np.linspace(low, high, 2 if degree == 1 else MOST_KNOTS)
    return knots, (knots - term.centre)[:, None] ** np.arange(1, degree + 1)


def _of_interval(term: IntervalTerm, ramp: float) -> tuple[FloatArray, FloatArray]:
    if term.low is not None and term.high is not None:
        ramp = min(ramp, 0.25 * (term.high - term.low))
    knots: list[float] = []
    shape: list[float] = []
    for end, before in ((term.low, 0.0), (term.high, 1.0)):
        if end is not None:
            knots += [end - ramp, end + ramp]
            shape += [before, 1.0 - before]
    return np.array(knots), np.array(shape)[:, None]
