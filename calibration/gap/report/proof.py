"""The proof: what was named and what has no name, held against flights that no fit saw."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.gap.data.found_effect import FoundEffect, FoundParameter, separations
from calibration.gap.data.record import FlightRecord
from calibration.gap.estimate.acceptance import NINETY_FIVE
from calibration.gap.estimate.held_out import HeldOutFlights, improvement
from calibration.gap.estimate.refine import Fitted, Training
from calibration.gap.replay import PredictionErrors, evaluate
from calibration.gap.report.document import Gap
from calibration.gap.report.predicted_worse import predicted_worse
from calibration.gap.report.prediction_figures import acted_on, prediction_gap
from calibration.gap.report.remaining import own_floor
from calibration.gap.search.forward import Search
from calibration.gap.search.naming import UNNAMED, Named, as_believed
from calibration.gap.search.retest import FAILED
from calibration.gap.search.unnamed_curves import UnnamedCurves, unnamed_curves


@dataclass(frozen=True, kw_only=True)
class Proof:
    """What flights that no fit saw leave of a search.

    Attributes:
        held_out: these flights; where none was kept back, those that were fitted.
        names: what is believed, with the curves of what has no name.
        believed: the fit with these names and all terms without one.
        stages: predictions of these flights before, after each effect, and with all.
        by_names: the gap that names alone close.
        effects: those that were named, with what each does for these flights.
        own: m, position error by what each of these flights has of its own.
    """

    held_out: Sequence[FlightRecord]
    names: Named
    unnamed: UnnamedCurves
    believed: Fitted
    stages: dict[str, PredictionErrors]
    by_names: Gap
    own: float
    effects: Sequence[FoundEffect]


def proof(
    found: Search,
    names: Named,
    training: Training,
    kept_back: Sequence[FlightRecord],
    source: str,
    rng: np.random.Generator,
) -> Proof:
    """Hold what a search found against `kept_back`, the flights that no fit saw.

    `source` is the provenance of the numbers, for the vehicle file.
    """
    # A ceiling whose height the search has found is over the flights that are predicted, too.
    ceiling = names.model.ceiling_z
    fitted, unseen = ([one.under(ceiling) for one in some] for some in (training.records, kept_back))
    held_out = unseen or fitted
    stages = _stages(names, held_out)
    own = own_floor(found.final, len(held_out))
    if reason := predicted_worse(names, stages, own, fitted):
        names = names.without_any(reason)
        stages = _stages(names, held_out)
    believed = as_believed(found, names, training)
    unnamed = unnamed_curves(names, believed, kept_back, source)
    by_names = prediction_gap(stages)
    names, unnamed = _with_curves(names, unnamed, stages, held_out)
    return Proof(
        held_out=held_out,
        names=names,
        unnamed=unnamed,
        believed=believed,
        stages=stages,
        by_names=by_names,
        own=own,
        effects=found_effects(names, HeldOutFlights(held_out), rng),
    )


def _stages(names: Named, records: Sequence[FlightRecord]) -> dict[str, PredictionErrors]:
    stages = {name: evaluate(records, model.vehicle()) for name, model in names.models().items()}
    if len(stages) == 1:
        stages["after"] = stages["before"]
    return stages


def _with_curves(
    names: Named, unnamed: UnnamedCurves, stages: dict[str, PredictionErrors], records: Sequence[FlightRecord]
) -> tuple[Named, UnnamedCurves]:
    """The names with the curves, whose predictions are added to the stages; without them, where those are
    worse: nobody knows a physics that would speak for them."""
    if not unnamed.curves:
        return names, unnamed
    added = dataclasses.replace(names, curves=tuple(unnamed.curves.values()))
    errors = evaluate(records, added.models()[UNNAMED].vehicle())
    *_, last = stages.values()
    if any(levels.after > levels.before for levels in acted_on(last, errors, added.curves)):
        return names, unnamed.without_any(FAILED)
    stages.pop("after", None)  # where there are no names
    stages[UNNAMED] = errors
    return added, unnamed


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
                **vars(gain),
                ambiguous_with=rivals,
                separated_by=separations([name, *rivals]) if rivals else "",
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
