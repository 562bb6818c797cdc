"""Whether an effect of a fit would be believed, were it named: it ran into no bound, does not depend on how
hard the vehicle was flown, and is one number for all flights where it must be."""

from calibration.gap.estimate.acceptance import (
    clustered_errors,
    drifting,
    runs_out,
    where_they_carry,
)
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.search.differing import another_in_each


def credible(fitted: Fitted, effect: str, training: Training) -> bool:
    """Whether nothing about the numbers that carry an effect speaks against it.

    Args:
        fitted: a fit with the effect, with derivatives of its own.
        effect: its name.
        training: the flights.
    """
    errors = clustered_errors(fitted, training)
    own = [v for v in fitted.variables if v.effect == effect]
    at_bound = [v for v in own if runs_out(fitted, v, errors[v])]
    return not (
        where_they_carry(at_bound, own, fitted, errors)
        or drifting(own, fitted, errors)
        or another_in_each(own, fitted, errors)
    )
