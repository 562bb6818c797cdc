"""Effects as the report has them: those found in the air, and those of legs and feet at landings."""

import math
from collections.abc import Sequence

import numpy as np

from calibration.gap.data.found import FoundEffect, FoundParameter
from calibration.gap.estimate.acceptance import NINETY_FIVE
from calibration.gap.estimate.held_out import HeldOutFlights, improvement
from calibration.gap.landings import LandingEffect, LandingFindings
from calibration.gap.report.document import Landings, UnusableFile
from calibration.gap.search.naming import Named
from onboard.vehicle import EFFECTS, Vehicle


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


def landing_effects(findings: Sequence[LandingEffect], vehicle: Vehicle) -> list[FoundEffect]:
    """Effects of legs and feet as the report has them; a factor multiplies that of the vehicle file."""
    filed = {effect.name: effect.values() for effect in vehicle.effects}
    effects = []
    for finding in findings:
        parameters = {}
        for key, (value, (low, high)) in finding.parameters.items():
            factor = filed.get(finding.effect, {}).get(key, 1.0) if key == "scale" else 1.0
            parameters[key] = FoundParameter(
                value=factor * value,
                unit=EFFECTS[finding.effect].parameters[key].unit,
                ci95=(factor * low, factor * high),
                at_bound=key in finding.at_bound,
            )
        effects.append(
            FoundEffect(
                name=finding.effect,
                parameters=parameters,
                error_before=finding.error_before,
                error_after=finding.error_after,
                improvement_ci95=finding.improvement_ci95,
                ambiguous_with=finding.ambiguous_with,
                separated_by=separations([finding.effect, *finding.ambiguous_with]),
                metric="pitch and roll rate in the 0.3 s after contact, median over landings, rad/s",
            )
        )
    return effects


def landing_section(found: LandingFindings) -> Landings:
    """Which landings could be judged and which were refused, as the report has it."""
    misfit = found.misfit
    return Landings(
        usable=found.usable,
        refused=tuple(UnusableFile(file=item.name, reason=item.reason) for item in found.unused),
        misfit=misfit if misfit is not None and math.isfinite(misfit) else None,
        flips=found.flip,
    )


def separations(names: Sequence[str]) -> str:
    """What a flight must do to tell effects apart, in words."""
    return "; ".join(f"{name}: {EFFECTS[name].revealed_by}" for name in names)
