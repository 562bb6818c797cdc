"""Terms without a name as curves of a vehicle file: those that are functions of the flight's state."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from calibration.gap.data.channels import BY_NAME, ResidualChannel
from calibration.gap.estimate.refine import Fitted
from calibration.gap.estimate.shared_nuisances import SharedNuisance, shared_nuisances
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


_LEVELS = {
    **{f"force_{axis}": f"force_bias_{axis}" for axis in "xy"},
    **{f"torque_{axis}": f"torque_trim_{axis}" for axis in "xyz"},
}
"""By channel, the nuisance that takes what a term is on average: a term alone tells how a force changes, the
trim of a flight the rest. What all flights share of that is the term's."""


class WordedTerm(NamedTuple):
    """A term of a fit: what it is in words, its curve, and why it has none (empty where it has one)."""

    formula: str
    curve: UnnamedCurve | None
    why_not: str


def worded_terms(fitted: Fitted, parameters: Any, source: str) -> Iterator[WordedTerm]:
    """Every term without a name of a fit, in the order in which they were found; the first of a channel with
    the level there that all flights share. Then the trims of torque that are left: what all flights share of
    them, and no name explains.

    Args:
        fitted: the fit.
        parameters: record of the physics of the vehicle that gets the curves: its mass and inertia make
            forces and torques of what the flights show, which are accelerations.
        source: provenance of the numbers, for the file.
    """
    covariance = fitted.estimate.fit.covariance
    first = len(fitted.variables)
    levels = {one.name: one for one in shared_nuisances(fitted, fitted.model.base)}
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
            level = levels.pop(_LEVELS.get(term.channel.name, ""), None)
            of_all, error = (0.0, 0.0) if level is None else (level.mean, level.error)
            formula += f" and {scale * of_all:.3g} everywhere" if level else ""
            curve = UnnamedCurve(
                channel=term.channel.name,
                regressor=term.regressor,
                knots=tuple(knots.tolist()),
                values=tuple((scale * (shapes @ values + of_all)).tolist()),
                sigma=scale * float(np.sqrt(variance.max() + error**2)),
                source=f"{source}; without a name: {formula}",
            )
            yield WordedTerm(formula, curve, "")
    # A force that is left may be the accelerometer's; a gyro's rate has no such part of its own.
    for channel in (BY_NAME[f"torque_{axis}"] for axis in "xyz"):
        if level := levels.get(_LEVELS[channel.name]):
            yield _everywhere(channel, level, _scale(channel, parameters), source)


def _everywhere(channel: ResidualChannel, level: SharedNuisance, scale: float, source: str) -> WordedTerm:
    """A torque that is the same wherever the vehicle flies: a curve without a slope."""
    torque = scale * level.mean
    formula = f"{torque:.3g} N m {channel.words} everywhere"
    curve = UnnamedCurve(
        channel=channel.name,
        regressor="z",
        knots=(0.0, 1.0),
        values=(torque, torque),
        sigma=scale * level.error,
        source=f"{source}; without a name: {formula}",
    )
    return WordedTerm(formula, curve, "")


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
