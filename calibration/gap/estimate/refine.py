"""Fit the parameters of a model to flights: Gauss-Newton steps, noise fitted anew at each."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.data.channels import ResidualChannel
from calibration.gap.data.excitation import commanded, excitation_weights, quiet_level
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import PARTS, TORQUE, stack_signals
from calibration.gap.data.split import FEW, folds
from calibration.gap.estimate.mixed import FIRST_SPREAD, MOST, Prior, held_out_shares
from calibration.gap.estimate.model import Model, Variable, kinds_that_tell
from calibration.gap.estimate.regression import LinearisedFit, Noise, Regression
from calibration.gap.estimate.unstated import prior_of_unstated, unstated
from onboard.arrays import FloatArray
from onboard.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class UnnamedTerm(ABC):
    """Something that no named effect describes, linear in its values.

    Attributes:
        regressor: name of what it goes with; "time" for a line.
        columns: signals per unit of each value (m/s2, rad/s2 or V), shape (n, 7) each.
    """

    channel: ResidualChannel
    regressor: str
    columns: tuple[FloatArray, ...]

    @abstractmethod
    def formula(self, values: FloatArray, vehicle: Vehicle) -> str:
        """The term in words, with numbers.

        Args:
            values: fitted, one per column.
            vehicle: whose mass and inertia turn accelerations into forces and torques.
        """


_ENOUGH = 0.1
"""Standard errors: a step this small ends the iteration."""

_CLOSE = 3.0
"""Standard errors: after a step no longer than this the derivatives are what they were."""

_UNNAMED_RANGE = 100.0
"""Range of the coefficient of an unnamed term, in the unit of its channel."""

_SCALES = (Variable("thrust_scale", "scale"), Variable("mass_error", "relative"))
_MOTORS = tuple(Variable("motor_imbalance", motor) for motor in ("m1", "m2", "m3", "m4"))
_GAUGE = 1e-3
"""Four motors that are all stronger are a scale of thrust, or a mass. Where both are fitted the mean of the
four is 1, give or take this; else nothing tells how much of it is whose, and none of the five is known."""

_LONGEST = 0.34
"""Share of a variable's bounds that one step may go."""

_TOWARDS, _NEAR = 0.7, 0.01
"""Share of the way to a bound that one step may go; share of the bounds' range from which it may go all."""


@dataclass(frozen=True)
class Training:
    """Flights to fit to.

    Attributes:
        by_shape: fold of each part of a flight; flights of one kind are in one fold.
        by_time: fold of each part, neighbours apart: for effects that one or two flights alone show.
        quiet: variance of the angular acceleration that is commanded where nobody asks for any, shape (3,).
    """

    records: tuple[FlightRecord, ...]
    regression: Regression
    by_shape: np.ndarray
    by_time: np.ndarray
    quiet: FloatArray

    @property
    def flight_of_part(self) -> np.ndarray:
        """Index of the flight of each part."""
        return np.arange(self.by_shape.size) // PARTS


def training_set(records: Sequence[FlightRecord], model: Model, quiet: FloatArray | None = None) -> Training:
    """Flights to fit to, with their folds.

    Args:
        records: the flights.
        model: says how hard each was flown.
        quiet: as of other flights of the vehicle; None: as the quietest of these are.
    """
    signals = stack_signals(records)
    variance = commanded(signals, model.predict(records))
    quiet = quiet_level(variance) if quiet is None else quiet
    by_time = (np.arange(len(records) * PARTS) + np.arange(len(records) * PARTS) // PARTS) % 2
    return Training(
        records=tuple(records),
        regression=Regression(signals, excitation_weights(variance, quiet)),
        by_shape=np.repeat(folds(records), PARTS),
        by_time=by_time,
        quiet=quiet,
    )


@dataclass(frozen=True)
class Fitted:
    """A model with fitted parameters.

    Attributes:
        model: with the values found.
        variables: that were fitted, in the order of the estimate's columns.
        estimate: linearised about (nearly) these values.
        held_out: log-likelihood of forces, torques and voltage of each part with the shared parameters of the
            other shapes' flights, shape (3, parts).
        held_out_in_time: likewise, with those of the other parts of all flights.
        folds: of each part, by kind of flight, shape (parts,).
        predicted: signals along the flights, shape (n, 7).
        columns: derivative of the signals by each variable, then by what no vehicle file states
            (:mod:`calibration.gap.estimate.unstated`), then the columns of the unnamed terms.
        unstated: what was known of that before these flights.
    """

    model: Model
    variables: tuple[Variable, ...]
    estimate: LinearisedFit
    held_out: FloatArray
    held_out_in_time: FloatArray
    folds: np.ndarray
    predicted: FloatArray
    columns: tuple[FloatArray, ...]
    unstated: Prior
    unnamed: tuple[UnnamedTerm, ...] = ()

    @property
    def columns_of_unstated(self) -> tuple[FloatArray, ...]:
        """What no vehicle file states would do."""
        return self.columns[len(self.variables) : self.first_unnamed]

    @property
    def first_unnamed(self) -> int:
        """Index of the first column of an unnamed term."""
        return len(self.variables) + self.unstated.mean.size

    @property
    def prior(self) -> Prior:
        """Of all coefficients, in the order of the estimate's columns."""
        return _prior(self.model, self.variables, self.unstated, len(self.columns) - self.first_unnamed)

    @property
    def known_of_unstated(self) -> Prior:
        """What is known after these flights of what no vehicle file states."""
        own = slice(len(self.variables), self.first_unnamed)
        fit = self.estimate.fit
        return Prior(fit.theta[own], np.asarray(np.linalg.inv(fit.covariance[own, own])))

    def gains(self, over: "Fitted", in_time: bool, kinds: Sequence[int] | None = None) -> FloatArray:
        """Gain in held-out log-likelihood of each part over another fit.

        A voltage decides about the battery alone, and torques have no say about a force
        (:func:`~calibration.gap.estimate.model.kinds_that_tell`): where nobody asks them, the model of their
        noise, which is fitted anew for every candidate, moves their likelihood by more than a name must gain.

        Args:
            over: the other fit.
            in_time: whether parts of all flights are held out, not kinds of flights: where few flights, or
                those of one kind, tell of what is new, the others could not have learned it.
            kinds: of signals that count; None: those that tell of the effects that one of the fits has.
        """
        if kinds is None:
            kinds = kinds_that_tell(set(self.model.effects) ^ set(over.model.effects))
        gained = self.held_out_in_time - over.held_out_in_time if in_time else self.held_out - over.held_out
        return np.asarray(gained[kinds].sum(axis=0))

    def columns_of(self, variables: Sequence[Variable]) -> list[int]:
        """Columns of the estimate that belong to these variables."""
        return [i for i, v in enumerate(self.variables) if v in variables]

    def wanted(self, variable: Variable) -> float:
        """The value that the flights ask for: as no step goes all the way to a bound, a fit that ends after a
        few of them may be well short of one that they are beyond."""
        value = self.model.start_value(variable)
        if variable not in self.variables:
            return value
        return value + float(self.estimate.fit.theta[self.variables.index(variable)])

    def few_flights(self, columns: Sequence[int]) -> bool:
        """Whether fewer than :data:`FEW` flights carry the information about any of these columns."""
        share = self._shares(columns, np.arange(self.folds.size) // PARTS)
        return bool(np.any((share**2).sum(axis=0) > 1.0 / FEW))

    def few_kinds(self, columns: Sequence[int]) -> bool:
        """Whether few flights, or those of one fold, carry most of the information about these columns."""
        return self.few_flights(columns) or bool(np.any(self._shares(columns, self.folds) > MOST))

    def _shares(self, columns: Sequence[int], group: np.ndarray) -> FloatArray:
        """Share of the information about each column that each group of parts has, (groups, columns)."""
        information = np.einsum("fgg->fg", self.estimate.fit.information)[:, list(columns)]
        summed = np.zeros((int(group.max()) + 1, len(columns)))
        np.add.at(summed, group, information)
        return summed / np.maximum(summed.sum(axis=0), 1e-300)


def prior_step(model: Model, variables: Sequence[Variable]) -> Prior:
    """What is believed of the step that each variable is from its value in `model`.

    Of most nothing is known but their bounds: no step, give or take the whole range. Where something is, a
    step to the usual value.
    """
    mean, precision = np.zeros(len(variables)), np.empty(len(variables))
    for index, v in enumerate(variables):
        rule = model.rule(v)
        precision[index] = (rule.high - rule.low) ** -2.0 if rule.spread is None else rule.spread**-2.0
        mean[index] = 0.0 if rule.spread is None else rule.typical - model.start_value(v)
    believed = Prior.independent(mean, precision)
    if any(scale in variables for scale in _SCALES) and all(motor in variables for motor in _MOTORS):
        weights = np.array([1.0 / len(_MOTORS) if v in _MOTORS else 0.0 for v in variables])
        start = np.array([model.start_value(v) for v in variables])
        believed = believed.tied(weights, 1.0 - float(weights @ start), _GAUGE)
    return believed


def _prior(model: Model, variables: Sequence[Variable], beside: Prior, unnamed: int) -> Prior:
    free = Prior.independent(np.zeros(unnamed), np.full(unnamed, _UNNAMED_RANGE**-2.0))
    return prior_step(model, variables).and_of(beside).and_of(free)


def refine(
    model: Model,
    variables: Sequence[Variable],
    training: Training,
    iterations: int = 5,
    start: Fitted | None = None,
    unnamed: Sequence[UnnamedTerm] | None = None,
    near: Fitted | None = None,
    known_of_unstated: Prior | None = None,
) -> Fitted:
    """The model with `variables` fitted to the flights.

    Args:
        model: to start from.
        variables: to fit; the others keep their values.
        training: the flights.
        iterations: of Gauss and Newton, at most.
        start: an earlier fit, whose noise and spreads save time.
        unnamed: terms whose coefficients are fitted as well; None: those of `start`.
        near: a fit whose derivatives are near enough for a first look: those of its variables are not
            computed anew, which with many variables is most of the work.
        known_of_unstated: from other flights of the vehicle; None: nothing.
    """
    given = {} if near is None else dict(zip(near.variables, near.columns, strict=False))
    known = given
    terms = tuple(unnamed if unnamed is not None else start.unnamed if start is not None else ())
    of_terms = [column for term in terms for column in term.columns]
    beside = unstated(model, training.records) if near is None else near.columns_of_unstated
    extra = [*beside, *of_terms]
    believed = prior_of_unstated(len(beside)) if known_of_unstated is None else known_of_unstated
    spread = FIRST_SPREAD if start is None else start.estimate.fit.spread
    noise: Noise | None = None if start is None else start.estimate.noise
    for iteration in range(1, iterations + 1):
        predicted = model.predict(training.records)
        columns = [
            known[v] if v in known else model.derivative(training.records, v, predicted) for v in variables
        ]
        columns = _mean_of_motors_by_forces(variables, columns)
        while True:
            prior = _prior(model, variables, believed, len(of_terms))
            estimate = training.regression.estimate(predicted, [*columns, *extra], prior, spread, noise)
            step = _bounded_step(model, variables, estimate.fit.theta)
            stuck = (step == 0.0) & (estimate.fit.theta[: len(variables)] != 0.0)
            if not stuck.any():
                break
            # A bound is not crossed: without those that would, the others settle elsewhere.
            variables = [v for v, out in zip(variables, stuck, strict=True) if not out]
            columns = [column for column, out in zip(columns, stuck, strict=True) if not out]
        errors = np.sqrt(np.diag(estimate.fit.covariance))[: len(variables)]
        arrived = bool(np.all(np.abs(step) <= _ENOUGH * errors))
        close = bool(np.all(np.abs(step) <= _CLOSE * errors))
        known = dict(zip(variables, columns, strict=True)) if close else given
        if iteration == iterations or (arrived and iteration > 1):  # by then the noise is of this model
            break
        model = model.with_values({v: model.start_value(v) + d for v, d in zip(variables, step, strict=True)})
        spread, noise = estimate.fit.spread, training.regression.fit_noise(estimate.residual)
    held_out, in_time = (
        held_out_shares(estimate.products, estimate.by_kind, estimate.fit, prior, split)
        for split in (training.by_shape, training.by_time)
    )
    return Fitted(
        model=model,
        variables=tuple(variables),
        estimate=estimate,
        held_out=held_out,
        held_out_in_time=in_time,
        folds=training.by_shape,
        predicted=predicted,
        columns=(*columns, *extra),
        unstated=believed,
        unnamed=terms,
    )


def settled(fitted: Fitted, training: Training) -> Fitted:
    """A fit to the end, from one with derivatives of a model near by."""
    return refine(fitted.model, fitted.variables, training, start=fitted)


def _mean_of_motors_by_forces(
    variables: Sequence[Variable], columns: Sequence[FloatArray]
) -> list[FloatArray]:
    """Derivatives by which torques tell only how motors differ: what all four share is a scale of thrust."""
    where = [index for index, v in enumerate(variables) if v in _MOTORS]
    given = list(columns)
    if len(where) < len(_MOTORS):
        return given
    shared = np.mean([columns[index][:, TORQUE] for index in where], axis=0)
    for index in where:
        given[index] = columns[index].copy(order="F")
        given[index][:, TORQUE] -= shared
    return given


def _bounded_step(model: Model, variables: Sequence[Variable], theta: FloatArray) -> FloatArray:
    step = np.empty(len(variables))
    for index, (v, wanted) in enumerate(zip(variables, theta, strict=False)):  # laws and unnamed ones follow
        rule, value = model.rule(v), model.start_value(v)
        extent = rule.high - rule.low
        room = (rule.high if wanted > 0.0 else rule.low) - value
        # A curved likelihood overshoots: nobody jumps onto a bound, where a variable would be given up.
        most = min(_LONGEST * extent, abs(room) if abs(room) < _NEAR * extent else _TOWARDS * abs(room))
        step[index] = np.clip(wanted, -most, most)
    return step
