"""Whether flights are predicted worse with all that was named than with nothing: then no name is believed."""

import math
from collections.abc import Mapping, Sequence

from calibration.gap.data.found_effect import FoundEffect
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

    `stages` are of the flights kept back. Their position may be worse with names by what each has of its
    `own` (m): a flight that lifts a little less may suit a wrong model. By any amount it may not where those
    that were `fitted` are clearly worse, too. A fit leaves to each part of a flight a scale of thrust of its
    own: a name that tells a torque well may bring a wrong thrust, which no likelihood resents.
    """
    kept_back = prediction_gap(stages).overall
    if kept_back.after > max(_CLEARLY * kept_back.before, math.hypot(kept_back.before, own)):
        return FAILED
    if not names.effects or kept_back.after <= kept_back.before:
        return None
    first, *_, last = (model.vehicle() for model in names.models().values())
    levels = prediction_gap({"before": evaluate(fitted, first), "after": evaluate(fitted, last)}).overall
    return FITTED_TOO if levels.after > _CLEARLY * levels.before else None


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
