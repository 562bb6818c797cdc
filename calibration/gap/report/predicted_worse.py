"""Whether flights are predicted worse with all that was named than with nothing: then no name is believed."""

import math
from collections.abc import Mapping, Sequence

from calibration.gap.data.found import FoundEffect
from calibration.gap.data.record import FlightRecord
from calibration.gap.replay import PredictionErrors, evaluate
from calibration.gap.report.prediction_figures import prediction_gap
from calibration.gap.search.naming import Named
from calibration.gap.search.retest import FAILED

FITTED_TOO = "flights are predicted worse with it, those that it was fitted to as well"

_CLEARLY = 1.05
"""Factor on the error of position beyond which a model is worse than another."""


def predicted_worse(
    names: Named, stages: Mapping[str, PredictionErrors], own: float, fitted: Sequence[FlightRecord]
) -> str | None:
    """Why no name is believed; None where names predict no worse than nothing.

    `stages` are of the flights kept back, of which each has its `own` (m); `fitted` are the others.
    """
    if worse_than_their_own(stages, own):
        return FAILED
    return FITTED_TOO if worse_where_fitted_too(names, stages, fitted) else None


def worse_than_their_own(stages: Mapping[str, PredictionErrors], own: float) -> bool:
    """Whether the position of flights kept back is predicted worse with all names than without any, by more
    than what each has of its `own` (m) explains: a flight that lifts a little less may suit a wrong model."""
    levels = prediction_gap(stages).overall
    return levels.after > max(_CLEARLY * levels.before, math.hypot(levels.before, own))


def worse_where_fitted_too(
    names: Named, stages: Mapping[str, PredictionErrors], fitted: Sequence[FlightRecord]
) -> bool:
    """Whether flights kept back are predicted worse by any amount, and those that were fitted clearly.

    A fit leaves to each part of a flight a scale of thrust of its own: a name that tells a torque well may
    bring a wrong thrust, which no likelihood resents. What a few flights have of their own may make a right
    model look worse on them, but not on those that it was fitted to. The arguments are those of
    :func:`predicted_worse`.
    """
    kept_back = prediction_gap(stages).overall
    if not names.effects or kept_back.after <= kept_back.before:
        return False
    first, *_, last = (model.vehicle() for model in names.models().values())
    levels = prediction_gap({"before": evaluate(fitted, first), "after": evaluate(fitted, last)}).overall
    return levels.after > _CLEARLY * levels.before


def no_better(
    stages: Mapping[str, PredictionErrors], own: float, effects: Sequence[FoundEffect]
) -> list[str]:
    """That flights kept back do not show what was named."""
    levels = prediction_gap(stages).overall
    if not effects or levels.after <= _CLEARLY * levels.before:
        return []
    return [
        f"the flights kept back are predicted no better ({levels.before:.3g} to {levels.after:.3g} m): each "
        f"has a thrust and lean of its own, which move it by about {own:.2g} m; fly more to confirm them"
    ]
