"""Effects found in the air as the report has them."""

import numpy as np

from calibration.gap.data.found import FoundEffect, FoundParameter, separations
from calibration.gap.estimate.acceptance import NINETY_FIVE
from calibration.gap.estimate.held_out import HeldOutFlights, improvement
from calibration.gap.search.naming import Named


def found_effects(names: Named, flights: HeldOutFlights, rng: np.random.Generator) -> list[FoundEffect]:
    """Effects as the report has them, with what each does for flights that no fit saw."""
    stages = list(names.models().values())
    errors = [flights.errors(model) for model in stages]
    effects = []
    for index, name in enumerate(names.effects):
        gain = improvement(errors[index], errors[index + 1], rng)
        rivals = names.ambiguous.get(name, ())
        effects.append(
            FoundEffect(
                name=name,
                parameters=found_parameters(name, names),
                error_before=gain.before,
                error_after=gain.after,
                improvement_ci95=gain.interval,
                ambiguous_with=rivals,
                separated_by=separations([name, *rivals]) if rivals else "",
                metric=gain.metric,
            )
        )
    return effects


def found_parameters(name: str, names: Named) -> dict[str, FoundParameter]:
    """The parameters of a named effect, each with its interval of 95 %."""
    parameters = {}
    for v, value in names.model.values.items():
        if v.effect == name:
            half, rule = NINETY_FIVE * names.errors.get(v, 0.0), names.model.rule(v)
            parameters[v.parameter] = FoundParameter(
                value=value,
                unit=rule.unit,
                ci95=(value - half, value + half),
                unseen=value - half <= rule.low and value + half >= rule.high,
            )
    return parameters
