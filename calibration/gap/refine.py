"""Fit the parameters of a model to flights: Gauss-Newton steps, noise fitted anew at each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.estimate import Estimate, Noise, Regression
from calibration.gap.mixed import FIRST_SPREAD, held_out_likelihood
from calibration.gap.model import Model, Variable
from calibration.gap.record import FlightRecord
from onboard.arrays import FloatArray

_ENOUGH = 0.2
"""Standard errors: a step this small ends the iteration."""

_LONGEST = 0.34
"""Share of a variable's bounds that one step may go."""


@dataclass(frozen=True)
class Training:
    """Flights to fit to.

    Attributes:
        records: the flights.
        regression: their signals.
        folds: fold of each flight; flights of one shape are in one fold.
    """

    records: tuple[FlightRecord, ...]
    regression: Regression
    folds: np.ndarray


@dataclass(frozen=True)
class Fitted:
    """A model with fitted parameters.

    Attributes:
        model: with the values found.
        variables: that were fitted, in the order of the estimate's columns.
        estimate: linearised about (nearly) these values.
        held_out: log-likelihood of each flight with the shared parameters of the other folds.
        predicted: signals along the flights, shape (n, 7).
        columns: derivative of the signals by each variable.
    """

    model: Model
    variables: tuple[Variable, ...]
    estimate: Estimate
    held_out: FloatArray
    predicted: FloatArray
    columns: tuple[FloatArray, ...]

    @property
    def score(self) -> float:
        """Held-out log-likelihood of all flights."""
        return float(self.held_out.sum())


def ridge(variables: Sequence[Variable]) -> FloatArray:
    """A weak prior about the present values: one standard deviation is the whole range."""
    return np.array([(v.high - v.low) ** -2.0 for v in variables])


def refine(
    model: Model,
    variables: Sequence[Variable],
    training: Training,
    iterations: int = 5,
    start: Estimate | None = None,
) -> Fitted:
    """The model with `variables` fitted to the flights.

    Args:
        model: to start from.
        variables: to fit; the others keep their values.
        training: the flights.
        iterations: of Gauss and Newton, at most.
        start: an earlier estimate, whose noise and spreads save time.
    """
    spread = FIRST_SPREAD if start is None else start.fit.spread
    noise: Noise | None = None if start is None else start.noise
    for _ in range(iterations):
        predicted = model.predict(training.records)
        columns = [model.derivative(training.records, v, predicted) for v in variables]
        estimate = training.regression.estimate(predicted, columns, ridge(variables), spread, noise)
        spread, noise = estimate.fit.spread, estimate.noise
        step = _bounded_step(model, variables, estimate.fit.theta)
        model = model.with_values({v: model.start_value(v) + d for v, d in zip(variables, step, strict=True)})
        stuck = (step == 0.0) & (estimate.fit.theta != 0.0)
        if stuck.any():  # a bound is not crossed: without them, the others settle elsewhere
            variables = [v for v, out in zip(variables, stuck, strict=True) if not out]
            continue
        if np.all(np.abs(step) <= _ENOUGH * np.sqrt(np.diag(estimate.fit.covariance))):
            break
    if stuck.any():
        estimate = training.regression.estimate(
            predicted, _kept(columns, ~stuck), ridge(variables), spread, noise
        )
        columns = _kept(columns, ~stuck)
    held_out = held_out_likelihood(estimate.products, estimate.fit, ridge(variables), training.folds)
    return Fitted(model, tuple(variables), estimate, held_out, predicted, tuple(columns))


def _kept(columns: Sequence[FloatArray], keep: np.ndarray) -> list[FloatArray]:
    return [column for column, kept in zip(columns, keep, strict=True) if kept]


def _bounded_step(model: Model, variables: Sequence[Variable], theta: FloatArray) -> FloatArray:
    step = np.empty(len(variables))
    for index, (v, wanted) in enumerate(zip(variables, theta, strict=True)):
        longest = _LONGEST * (v.high - v.low)
        value = model.start_value(v)
        step[index] = np.clip(value + np.clip(wanted, -longest, longest), v.low, v.high) - value
    return step
