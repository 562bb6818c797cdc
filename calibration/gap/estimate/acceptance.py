"""When a candidate has earned its name.

Flights are few and their noise is coloured, so that a gain in likelihood alone proves little: of 300 placebo
regressors "held-out gain > 0" called a third significant. A name needs all of these together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from calibration.gap.estimate.mixed import jackknife_errors
from calibration.gap.estimate.model import Model, Variable
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.estimate.shared_nuisances import swallowed
from calibration.measurement import drawn_again
from onboard.arrays import FloatArray

LEAST_GAIN = 15.0
"""Held-out log-likelihood that a name must gain."""

DETECTABLE = 4.0
"""Distance from the neutral value, in clustered standard errors, of at least one parameter."""

NINETY_FIVE = 1.96
"""Standard errors to either side of a 95 % interval."""

_AT_BOUND = 0.01
"""Share of the bounds' range within which a value counts as stuck there; where bounds are wide (a string may
be soft or stiff), half of what is worth a name."""

_DRIFT = 0.5
"""Share of its size by which a value may differ between quiet and hard flying."""

_CARRIES = 0.1
"""Share of the evidence for an effect that odd numbers may carry: the others make the name.
Along one axis of three a law may be another."""

_REPEATS = 400


@dataclass(frozen=True)
class Judgement:
    """What speaks for and against a candidate.

    Attributes:
        gain: held-out log-likelihood gained.
        significant: whether the gain and at least one parameter are beyond chance.
        sizeable: whether at least one parameter is as far from neutral as is worth a name.
        errors: clustered standard error of each new variable.
    """

    gain: float
    significant: bool
    sizeable: bool
    at_bound: tuple[Variable, ...]
    errors: dict[Variable, float]


def clustered_errors(fitted: Fitted, training: Training) -> dict[Variable, float]:
    """Standard error of each variable: of the model, or what flights left out in turn say if that is larger.

    Where few flights tell of a variable, their parts are left out instead of the flights. As many standard
    errors as make 95 % of a normal distribution make 95 % here: those of few flights are themselves known
    badly, and grow by Student's distribution with one degree of freedom less than there are flights.
    """
    fit = fitted.estimate.fit
    by_model = np.sqrt(np.diag(fit.covariance))
    by_flight, by_part = (
        _by_clusters(fitted, clusters)
        for clusters in (training.flight_of_part, np.arange(training.flight_of_part.size))
    )
    return {
        variable: float(
            max(by_model[index], by_part[index] if fitted.few_flights([index]) else by_flight[index])
        )
        for index, variable in enumerate(fitted.variables)
    }


def _by_clusters(fitted: Fitted, clusters: np.ndarray) -> FloatArray:
    free = int(clusters.max())
    widened = student.ppf(0.975, max(free, 1)) / NINETY_FIVE
    return jackknife_errors(fitted.estimate.fit, fitted.prior, clusters) * widened


def judge(
    present: Fitted, offered: Fitted, new: Sequence[Variable], training: Training, rng: np.random.Generator
) -> Judgement:
    """Whether `offered`, which adds the variables `new` to `present`, is to be believed."""
    fitted = [v for v in new if v in offered.variables]
    errors = {v: e for v, e in clustered_errors(offered, training).items() if v in fitted}
    columns = offered.columns_of(fitted)
    in_time = offered.few_kinds(columns)
    gains, otherwise = (offered.gains(present, way) for way in (in_time, not in_time))
    model = offered.model
    removable = [v for v in fitted if model.without_it(v) is not None]
    far = not removable or any(abs(model.change(v)) >= DETECTABLE * errors[v] for v in removable)
    lower = lower_bound(gains, training, offered.few_flights(columns), rng)
    beyond_chance = far and float(gains.sum()) >= LEAST_GAIN and lower > 0.0
    if swallowed(offered, present) and not swallowed(present, offered):
        # That all flights share it, a nuisance has shown beyond chance; what is slow tells its own size
        # badly, and gains little where noise is whitened.
        beyond_chance = beyond_chance or min(gains.sum(), otherwise.sum()) > 0.0
    return Judgement(
        gain=float(gains.sum()),
        significant=bool(fitted) and beyond_chance,
        sizeable=any(sizeable(model, v) for v in fitted),
        at_bound=tuple(v for v in fitted if runs_out(offered, v, errors[v])),
        errors=errors,
    )


def sizeable(model: Model, variable: Variable) -> bool:
    """Whether a value is far enough from what the vehicle file says to be worth a name."""
    least = model.rule(variable).practical_minimum
    return model.nothing_new(variable) is None or abs(model.change(variable)) >= least


def drifting(
    variables: Sequence[Variable], offered: Fitted, errors: Mapping[Variable, float]
) -> tuple[Variable, ...]:
    """Those of an effect's fitted variables about which quiet and hard flying disagree, where they matter."""
    return where_they_carry([v for v in variables if drift(v, offered) > 0.0], variables, offered, errors)


def where_they_carry(
    odd: Sequence[Variable], variables: Sequence[Variable], offered: Fitted, errors: Mapping[Variable, float]
) -> tuple[Variable, ...]:
    """The `odd` ones of an effect's fitted variables, if they carry the evidence for it; else none."""
    if any(offered.model.nothing_new(v) is None for v in variables):
        return tuple(odd)
    evidence = {v: (offered.model.change(v) / errors[v]) ** 2 for v in variables}
    return tuple(odd) if sum(evidence[v] for v in odd) > _CARRIES * sum(evidence.values()) else ()


def drift(variable: Variable, offered: Fitted) -> float:
    """By how much quiet and hard flying disagree about a value; 0 where that may be chance, or is little.

    A command that answers a disturbance looks like a wrong lever or inertia; how wrong depends on how much of
    the motion was commanded. A true effect has one size.
    """
    column = offered.variables.index(variable)
    information = offered.estimate.fit.information[:, column, column]
    score = offered.estimate.fit.score - np.einsum(
        "pgh,h->pg", offered.estimate.fit.information, offered.estimate.fit.theta
    )
    order = np.argsort(information)
    half = np.searchsorted(np.cumsum(information[order]), 0.5 * information.sum())
    quiet, hard = order[:half], order[half:]
    steps = [score[part, column].sum() / max(information[part].sum(), 1e-300) for part in (quiet, hard)]
    error = np.sqrt(sum(1.0 / max(information[part].sum(), 1e-300) for part in (quiet, hard)))
    difference = float(abs(steps[1] - steps[0]))
    size = abs(offered.model.change(variable))
    return difference if difference > max(DETECTABLE * error, _DRIFT * size) else 0.0


def stuck(model: Model, variable: Variable) -> bool:
    """Whether a value ended at a bound, where it stands in for something else."""
    rule, value = model.rule(variable), model.start_value(variable)
    margin = min(_AT_BOUND * (rule.high - rule.low), 0.5 * rule.practical_minimum)
    at_neutral = rule.neutral is not None and abs(value - rule.neutral) < margin
    return not at_neutral and (value > rule.high - margin or value < rule.low + margin)


def runs_out(fitted: Fitted, variable: Variable, error: float) -> bool:
    """Whether a value ended at a bound, or the flights ask for one beyond it.

    Where they hardly tell it (`error`: its standard error) they ask for nothing.
    """
    model = fitted.model
    rule, wanted = model.rule(variable), fitted.wanted(variable)
    too_high = wanted > rule.high and rule.high != rule.neutral
    too_low = wanted < rule.low and rule.low != rule.neutral
    told = abs(model.change(variable)) >= DETECTABLE * error
    return stuck(model, variable) or (told and (too_high or too_low))


def lower_bound(gains: FloatArray, training: Training, few: bool, rng: np.random.Generator) -> float:
    """2.5 % quantile of the summed gain with flights (or parts, where few flights tell) drawn anew."""
    flights = np.bincount(training.flight_of_part, weights=gains)
    values = gains[np.abs(gains) > 0.5] if few else flights
    if values.size == 0:
        return 0.0
    drawn = values[drawn_again(values.size, _REPEATS, rng)].sum(axis=1)
    return float(np.quantile(drawn, 0.025))
