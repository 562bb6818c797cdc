"""Axes of an effect that end at a bound: they keep the vehicle file's value, and the others their own."""

from collections.abc import Collection, Sequence

from calibration.gap.estimate.acceptance import clustered_errors, runs_out
from calibration.gap.estimate.model import Variable
from calibration.gap.estimate.refine import Fitted, Training, refine
from onboard.vehicle import EFFECTS

AT_BOUND = "{} ran into its bound: it stands in for something else"
"""Why a parameter is not believed."""


def other_axes(effect: str, own: Sequence[Variable], at_bound: Collection[Variable]) -> tuple[Variable, ...]:
    """Those of an effect's `own` variables that need not care that others are `at_bound`.

    None do where nothing is, or where the effect's parameters are not one quantity along several axes.
    """
    rules = EFFECTS[effect].parameters.values()
    one_quantity = len({(rule.unit, rule.low, rule.high, rule.neutral) for rule in rules}) == 1
    if not at_bound or not one_quantity or any(rule.neutral is None for rule in rules):
        return ()
    return tuple(v for v in own if v not in at_bound)


def refused_axes(effect: str, at_bound: Sequence[Variable]) -> dict[str, str]:
    """Axes of an effect, as one name, and why they are not believed; empty where none is `at_bound`."""
    names = ", ".join(v.parameter for v in at_bound)
    return {f"{effect} {names}": AT_BOUND.format(names)} if names else {}


def without_axes_at_bounds(present: Fitted, training: Training, refused: dict[str, str]) -> Fitted:
    """The fit with the vehicle file's value along axes that ended at a bound, where others of it did not."""
    errors = clustered_errors(present, training)
    for effect in present.model.effects:
        own = [v for v in present.model.values if v.effect == effect]
        beyond = [v for v in own if runs_out(present, v, errors.get(v, 0.0))]
        if other_axes(effect, own, beyond):
            refused |= refused_axes(effect, beyond)
            model = present.model.without_values(beyond)
            kept = [v for v in present.variables if v not in beyond]
            present = refine(model, kept, training, start=present)
    return present
