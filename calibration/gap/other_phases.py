"""Effects that are not found in the air: of the sensors, and of legs and feet at landings."""

from collections.abc import Sequence

from calibration.gap.improved import separations
from calibration.gap.landing import Finding
from calibration.gap.report import FoundEffect, FoundParameter
from calibration.gap.sensing import SensingEffect
from onboard.vehicle import EFFECTS, Vehicle


def sensing_effects(effects: Sequence[SensingEffect]) -> list[FoundEffect]:
    """Effects of the sensors as the report has them."""
    return [
        FoundEffect(
            name=effect.name,
            parameters={
                key: FoundParameter(
                    value=value, unit=EFFECTS[effect.name].parameters[key].unit, ci95=effect.intervals[key]
                )
                for key, value in effect.values.items()
            },
            error_before=effect.error_before,
            error_after=effect.error_after,
            improvement_ci95=effect.improvement_ci95,
            metric=f"{effect.metric}, {effect.unit}",
        )
        for effect in effects
    ]


def landing_effects(findings: Sequence[Finding], vehicle: Vehicle) -> list[FoundEffect]:
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
