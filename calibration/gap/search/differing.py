"""Named effects whose size differs from flight to flight, though the model has one size for all.

A wind that was on for some of the flights, a payload, another battery: each flight by itself tells a step
from the common value, and these steps scatter by more than their errors (random effects: DerSimonian and
Laird, Controlled Clinical Trials 7, 1986). That is said flight by flight. What belongs to the vehicle itself
(a drag, an inertia, a lag) cannot be another in each flight: where it seems so, it is the nearest name of
something else, and gets none.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from calibration.gap.data.signals import PARTS
from calibration.gap.estimate.acceptance import where_they_carry
from calibration.gap.estimate.model import Variable
from calibration.gap.estimate.refine import Fitted
from onboard.arrays import FloatArray
from onboard.vehicle import EFFECTS

DIFFERS = "{} is another in each flight, though it belongs to the vehicle: it stands in for something else"
"""Why a parameter is not believed."""

_CHANCE = 4.0
"""Standard deviations of the scatter of equal flights beyond which theirs is not chance."""

_SHARE = 0.5
"""Of a value by which it must scatter to be said to differ: less is within what its name promises."""


_TELLS = 0.01
"""Of the information that the flight has which tells a parameter best: one that has less says nothing of it.
Where nothing is commanded, what turns the vehicle is answered, and a law looks weaker than it is."""


class Differing(NamedTuple):
    """A parameter of which flights have values of their own.

    Attributes:
        variable: which.
        scatter: standard deviation over flights, beyond the errors, in the parameter's unit.
        values, errors: of each flight by itself, shape (flights,); NaN where a flight says nothing.
    """

    variable: Variable
    scatter: float
    values: FloatArray
    errors: FloatArray

    @property
    def error_of_mean(self) -> float:
        """Standard error of the mean over the flights that tell, by their scatter alone."""
        return self.scatter / math.sqrt(np.count_nonzero(np.isfinite(self.values)))


def differing(final: Fitted, names: Sequence[str]) -> tuple[Differing, ...]:
    """The parameters of these effects that differ between the flights of a fit."""
    found = (_scatter(final, v) for v in final.variables if v.effect in names)
    return tuple(
        one
        for one in found
        if one is not None
        and one.scatter
        > max(
            final.model.rule(one.variable).practical_minimum, _SHARE * abs(final.model.change(one.variable))
        )
    )


def another_in_each(
    variables: Sequence[Variable], final: Fitted, errors: Mapping[Variable, float]
) -> tuple[Variable, ...]:
    """Those of an effect's fitted variables that differ between flights and cannot, where they matter.

    Args:
        variables: all of the effect.
        final: the fit.
        errors: standard error of each variable.
    """
    names = {v.effect for v in variables if not EFFECTS[v.effect].may_differ}
    odd = {one.variable: one for one in differing(final, sorted(names))}
    # A mean over flights that scatter is known no better than they let it (random effects).
    known = {v: math.hypot(e, odd[v].error_of_mean) if v in odd else e for v, e in errors.items()}
    return where_they_carry(tuple(odd), variables, final, known)


def _scatter(final: Fitted, variable: Variable) -> Differing | None:
    """How the steps that single flights would take scatter; None where that is chance."""
    fit, column = final.estimate.fit, final.variables.index(variable)
    left = fit.score - np.einsum("pgh,h->pg", fit.information, fit.theta)
    weights = fit.information[:, column, column].reshape(-1, PARTS).sum(axis=1)
    told = weights > _TELLS * weights.max()
    free = int(np.count_nonzero(told)) - 1
    if free < 1:
        return None
    errors = np.full(weights.size, np.nan)
    errors[told] = weights[told] ** -0.5
    steps = left[:, column].reshape(-1, PARTS).sum(axis=1) * errors**2
    mean = np.average(steps[told], weights=weights[told])
    squares = float(weights[told] @ (steps[told] - mean) ** 2)
    if squares < free + _CHANCE * math.sqrt(2.0 * free):
        return None
    total = float(weights.sum())
    scatter = math.sqrt((squares - free) / (total - float(weights @ weights) / total))
    return Differing(variable, scatter, final.model.start_value(variable) + steps, errors)


def in_words(one: Differing, unit: str, flights: Sequence[str]) -> str:
    """A sentence with the value of each flight.

    Args:
        one: what differs.
        unit: of its values.
        flights: their names.
    """
    behind = "" if unit == "1" else f" {unit}"
    each = ", ".join(
        f"{name} {value:.3g} +- {1.96 * error:.2g}"
        for name, value, error in zip(flights, one.values, one.errors, strict=True)
        if np.isfinite(value)
    )
    effect, parameter = one.variable
    return (
        f"{effect} differs between flights: {parameter} scatters by {one.scatter:.2g}{behind}, and the "
        f"vehicle file has one value for all ({each}); fit flights that belong together apart"
    )
