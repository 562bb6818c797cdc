"""Find the gap: sensors first, then the missing effects, then the proof on flights that no fit saw."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calibration.gap.acceptance import clustered_errors, sizeable
from calibration.gap.exchange import needed
from calibration.gap.held_out import HeldOutFlights, improvement
from calibration.gap.improved import FoundValue, improved_vehicle, provenance, separations
from calibration.gap.model import Model, Variable
from calibration.gap.prediction import PredictionErrors, evaluate
from calibration.gap.prediction.shown import channel_bars, horizon_curves, phase_bars, prediction_gap
from calibration.gap.record import FlightRecord
from calibration.gap.refine import Fitted, Training, training_set
from calibration.gap.report import (
    FoundEffect,
    FoundParameter,
    GapReport,
    Rejected,
    ReportFigures,
    Unexplained,
    UnusableFile,
    Verdict,
)
from calibration.gap.search import LOG_TIMING, Progress, Search, named, search
from calibration.gap.sensing import SensingEffect, apply_sensing, judge_sensing
from calibration.gap.split import split_flights
from onboard.vehicle import EFFECTS, Vehicle

_NINETY_FIVE = 1.96


@dataclass(frozen=True)
class GapResult:
    """What was found.

    Attributes:
        report: the document.
        figures: what its page draws.
        vehicle: the improved model.
    """

    report: GapReport
    figures: ReportFigures
    vehicle: Vehicle


@dataclass(frozen=True)
class Named:
    """Effects of the vehicle that were named.

    Attributes:
        effects: names, in the order found.
        model: the base vehicle with these effects alone.
        errors: clustered standard error of each variable.
    """

    effects: tuple[str, ...]
    model: Model
    errors: dict[Variable, float]


def find_gap(
    records: Sequence[FlightRecord],
    vehicle: Vehicle,
    seed: int = 0,
    ceiling_z: float | None = None,
    unusable: Sequence[UnusableFile] = (),
    limitations: Sequence[str] = (),
    progress: Progress = lambda _: None,
) -> GapResult:
    """Find what a vehicle file lacks.

    Args:
        records: measured flights.
        vehicle: the model.
        seed: of all random numbers.
        ceiling_z: m, height of the ceiling, if known.
        unusable: files that were refused before, for the report.
        limitations: what these flights cannot show, for the report.
        progress: told what is being looked at.
    """
    rng = np.random.default_rng(seed)
    progress("sensors")
    sensing = judge_sensing(records)
    corrected = apply_sensing(records, sensing)
    fit_to, kept_back = split_flights(corrected)
    training = training_set([corrected[i] for i in fit_to])
    found = search(Model(vehicle, {}, ceiling_z), training, rng, progress)
    names = _named(found, training, rng)
    held_out = [corrected[i] for i in kept_back] or list(training.records)
    progress("flights that no fit saw")
    effects = _effects(names, found, HeldOutFlights(held_out), rng)
    stages = _stages(names, held_out)
    sensed = [_sensing_effect(effect) for effect in sensing.effects]
    improved = improved_vehicle(
        vehicle,
        {**_sensing_values(sensing.effects), **_values(names)},
        provenance(len(fit_to), len(kept_back), seed),
    )
    report = GapReport(
        verdict=Verdict.EFFECTS_FOUND if effects or sensed else Verdict.NO_GAP,
        vehicle=vehicle.name,
        effects=(*sensed, *effects),
        gap=prediction_gap(stages),
        where=(),
        unexplained=Unexplained(share=0.0),
        train=tuple(record.name for record in training.records),
        held_out=tuple(corrected[i].name for i in kept_back),
        unusable=(*unusable, *(UnusableFile(file=b.name, reason=b.reason) for b in sensing.broken)),
        rejected=tuple(Rejected(name=name, reason=reason) for name, reason in found.refused.items()),
        limitations=(*limitations, *sensing.notes, *_limits(kept_back)),
        seed=seed,
        noise=_noise(found.final),
    )
    figures = ReportFigures(
        horizons=horizon_curves(stages), channels=channel_bars(stages), phases=phase_bars(stages)
    )
    return GapResult(report, figures, improved)


def _named(found: Search, training: Training, rng: np.random.Generator) -> Named:
    """The named effects of a search; the log's timing among them where it is beyond the doubt about it."""
    order = [step.effect for step in named(found.steps)]
    doubt = 0.5 * training.regression.signals.dt
    delay = found.final.model.values.get(LOG_TIMING, 0.0)
    if (
        delay > doubt
        and LOG_TIMING in found.final.variables
        and needed(found.final, LOG_TIMING.effect, training)
    ):
        order.append(LOG_TIMING.effect)
    values = {
        v: x
        for v, x in found.final.model.values.items()
        if v.effect in order and (v in found.final.variables or sizeable(v, x))
    }
    ordered = {v: x for name in order for v, x in values.items() if v.effect == name}
    model = Model(found.final.model.base, ordered, found.final.model.ceiling_z)
    return Named(tuple(order), model, clustered_errors(found.final, training, rng))


def _effects(
    names: Named, found: Search, flights: HeldOutFlights, rng: np.random.Generator
) -> list[FoundEffect]:
    effects = []
    model = Model(names.model.base, {}, names.model.ceiling_z)
    before = flights.errors(model)
    for name in names.effects:
        model = model.with_values({v: x for v, x in names.model.values.items() if v.effect == name})
        after = flights.errors(model)
        gain = improvement(before, after, rng)
        rivals = tuple(rival.effect for rival in found.ambiguous.get(name, ()))
        effects.append(
            FoundEffect(
                name=name,
                parameters=_parameters(name, names),
                error_before=gain.before,
                error_after=gain.after,
                improvement_ci95=gain.interval,
                ambiguous_with=rivals,
                separated_by=separations([name, *rivals]) if rivals else "",
                metric=f"{gain.channel} residual, means of 0.1 s, {gain.unit}",
            )
        )
        before = after
    return effects


def _parameters(name: str, names: Named) -> dict[str, FoundParameter]:
    return {
        v.parameter: FoundParameter(
            value=value,
            unit=EFFECTS[name].parameters[v.parameter].unit,
            ci95=_interval(value, names.errors.get(v, 0.0)),
        )
        for v, value in names.model.values.items()
        if v.effect == name
    }


def _interval(value: float, error: float) -> tuple[float, float]:
    return value - _NINETY_FIVE * error, value + _NINETY_FIVE * error


def _values(names: Named) -> dict[str, dict[str, FoundValue]]:
    return {
        name: {
            v.parameter: FoundValue(value, names.errors.get(v, 0.0))
            for v, value in names.model.values.items()
            if v.effect == name
        }
        for name in names.effects
    }


def _sensing_effect(effect: SensingEffect) -> FoundEffect:
    return FoundEffect(
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


def _sensing_values(effects: Sequence[SensingEffect]) -> dict[str, dict[str, FoundValue]]:
    return {
        effect.name: {
            key: FoundValue(
                value, (effect.intervals[key][1] - effect.intervals[key][0]) / (2.0 * _NINETY_FIVE)
            )
            for key, value in effect.values.items()
        }
        for effect in sensing_sorted(effects)
    }


def sensing_sorted(effects: Sequence[SensingEffect]) -> list[SensingEffect]:
    """Effects by name, so that the file does not depend on their certainty."""
    return sorted(effects, key=lambda effect: effect.name)


def _stages(names: Named, records: Sequence[FlightRecord]) -> dict[str, PredictionErrors]:
    """Predictions before, after each effect, and with all, on flights that no fit saw."""
    model = Model(names.model.base, {}, names.model.ceiling_z)
    stages = {"before": evaluate(records, model.vehicle())}
    for name in names.effects:
        model = model.with_values({v: x for v, x in names.model.values.items() if v.effect == name})
        stages[f"with {name}"] = evaluate(records, model.vehicle())
    if len(stages) == 1:
        stages["after"] = stages["before"]
    return stages


def _limits(kept_back: Sequence[int]) -> tuple[str, ...]:
    if kept_back:
        return ()
    return (
        "no flight could be kept back: the errors are on the flights that were fitted; fly more, each of "
        "the important manoeuvres at least twice",
    )


def _noise(final: Fitted) -> dict[str, Any]:
    from calibration.gap.nuisances import NUISANCES
    from calibration.gap.signals import CHANNELS, UNITS

    sigma, spread = final.estimate.noise.sigma, final.estimate.fit.spread
    return {
        "innovations": {
            name: {"sigma": float(s), "unit": unit}
            for name, s, unit in zip(CHANNELS, sigma, UNITS, strict=True)
        },
        "between_flights": {
            n.name: {"sigma": float(s), "unit": n.unit} for n, s in zip(NUISANCES, spread, strict=True)
        },
        "log_timing_s": float(final.model.values.get(LOG_TIMING, 0.0)),
    }
