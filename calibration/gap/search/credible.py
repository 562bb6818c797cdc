"""Whether an effect of a fit would be believed, were it named: it ran into no bound, does not depend on how
hard the vehicle was flown, and is one number for all flights where it must be."""

from calibration.gap.estimate.acceptance import clustered_errors, drifting, runs_out
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.search.bounds import other_axes
from calibration.gap.search.differing import another_in_each


def credible(fitted: Fitted, effect: str, training: Training) -> bool:
    """Whether nothing about the numbers that carry an effect speaks against it.

    Args:
        fitted: a fit with the effect.
        effect: its name.
        training: the flights.
    """
    errors = clustered_errors(fitted, training)
    values = [v for v in fitted.model.values if v.effect == effect]
    beyond = [v for v in values if runs_out(fitted, v, errors.get(v, 0.0))]
    if beyond and not other_axes(effect, values, beyond):
        return False
    own = [v for v in values if v in fitted.variables and v not in beyond]
    return not (drifting(own, fitted, errors) or another_in_each(own, fitted, errors))
