"""Whether an effect of a fit would be believed: it ran into no bound, does not depend on how hard the vehicle
was flown, and is one number for all flights where it must be."""

from collections.abc import Mapping, Sequence

from calibration.gap.estimate.acceptance import clustered_errors, drifting, runs_out
from calibration.gap.estimate.model import Variable
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.search.bounds import AT_BOUND, other_axes
from calibration.gap.search.differing import DIFFERS, another_in_each

DRIFTS = "{} depends on how hard the vehicle was flown: it stands in for something else"
"""Why a parameter is not believed."""


def credible(fitted: Fitted, effect: str, training: Training) -> bool:
    """Whether nothing about the numbers that carry an effect speaks against it; axes at a bound would go.

    Args:
        fitted: a fit with the effect.
        effect: its name.
        training: the flights.
    """
    errors = clustered_errors(fitted, training)
    own = [v for v in fitted.model.values if v.effect == effect]
    beyond = [v for v in own if runs_out(fitted, v, errors.get(v, 0.0))]
    return what_speaks_against(other_axes(effect, own, beyond) or own, fitted, errors) is None


def what_speaks_against(
    own: Sequence[Variable], fitted: Fitted, errors: Mapping[Variable, float]
) -> str | None:
    """Why an effect of a fit is not believed, in words; None where nothing speaks against it.

    Args:
        own: all of its variables, those that a fit gave up among them.
        fitted: the fit.
        errors: standard error of each variable that was fitted.
    """
    if at_bound := [v for v in own if runs_out(fitted, v, errors.get(v, 0.0))]:
        return AT_BOUND.format(_listed(at_bound))
    told = [v for v in own if v in fitted.variables]
    if unsteady := drifting(told, fitted, errors):
        return DRIFTS.format(_listed(unsteady))
    if differ := another_in_each(told, fitted, errors):
        return DIFFERS.format(_listed(differ))
    return None


def _listed(variables: Sequence[Variable]) -> str:
    return ", ".join(v.parameter for v in variables)
