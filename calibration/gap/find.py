"""Find the gap: sensors first, then the missing effects, then the proof on flights that no fit saw."""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from calibration.errors import CalibrationError
from calibration.flights import Flight
from calibration.gap.data import PreparedFlights, prepare_flights
from calibration.gap.data.duplicates import content_hash
from calibration.gap.data.found import FoundEffect
from calibration.gap.data.names import distinctly_named
from calibration.gap.data.record import FlightRecord, NotUsed
from calibration.gap.data.signals import CHANNELS, UNITS
from calibration.gap.data.split import split_flights
from calibration.gap.estimate.held_out import HeldOutFlights
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.nuisances import NUISANCES, STEADY
from calibration.gap.estimate.refine import Training, training_set
from calibration.gap.landings import LandingFindings, LandingVerdict, judge_landings
from calibration.gap.replay import PredictionErrors, evaluate
from calibration.gap.replay.hover_voltage import of_one_vehicle
from calibration.gap.replay.motor_order import check_motor_order
from calibration.gap.report.confidence import with_probability
from calibration.gap.report.document import (
    AmbiguousSet,
    GapReport,
    GapVerdict,
    Rejected,
    UnusableFile,
)
from calibration.gap.report.effects import found_effects
from calibration.gap.report.figures import figures, nameless_terms, unexplained, where
from calibration.gap.report.figures_data import ReportFigures
from calibration.gap.report.improved_vehicle import hard_to_fly, improved_vehicle, provenance
from calibration.gap.report.predicted_worse import no_better, predicted_worse
from calibration.gap.report.prediction_figures import acted_on, prediction_gap
from calibration.gap.report.remaining import chance_floor, own_floor, remaining
from calibration.gap.search.always import LOG_TIMING, law_in_words
from calibration.gap.search.conclusion import concluded
from calibration.gap.search.differing import differing, in_words
from calibration.gap.search.forward import Search
from calibration.gap.search.nameless import Nameless, nameless_curves
from calibration.gap.search.naming import FEWEST, NAMELESS, Named, as_believed
from calibration.gap.search.retest import FAILED
from calibration.gap.search.selection import Progress
from calibration.gap.sensors import SensingFindings, apply_sensing, judge_sensing, unsaid
from calibration.gap.unnamed.fitted_terms import FittedTerm, formulas, residual_map, with_consequence
from onboard.errors import InputError
from onboard.vehicle import EFFECTS, Vehicle


class NothingToFindError(CalibrationError, InputError):
    """Not one flight can be held against a model; the message says why."""


_VERSIONS = ("perchhw", "numpy", "scipy", "numba")
"""Packages whose next version may give other last digits."""


@dataclass(frozen=True)
class GapResult:
    """What was found.

    Attributes:
        report: the document.
        figures: what its page draws.
        vehicle: the improved model.
        ceiling_z: m, height of the ceiling: given, or found; None: it plays no part.
    """

    report: GapReport
    figures: ReportFigures
    vehicle: Vehicle
    ceiling_z: float | None


@dataclass(frozen=True, kw_only=True)
class GapQuestion:
    """What is asked.

    Attributes:
        vehicle: the model.
        seed: of all random numbers.
        ceiling_z: m, height of the ceiling, if known.
        unusable: files that were refused on reading.
    """

    vehicle: Vehicle
    seed: int = 0
    ceiling_z: float | None = None
    unusable: Sequence[UnusableFile] = field(default=())


def find_gap(
    flights: Sequence[Flight], question: GapQuestion, progress: Progress = lambda _: None
) -> GapResult:
    """Find what a vehicle file lacks.

    Args:
        flights: as read; those with a trigger are looked at for their landings.
        question: vehicle, seed, ceiling.
        progress: told what is being looked at.

    Raises:
        NothingToFindError: not one flight can be used.
    """
    # Small matrices, and flights in parallel already: threads of the linear algebra would only spin.
    with threadpool_limits(limits=1, user_api="blas"):
        return _find(flights, question, progress)


def _find(flights: Sequence[Flight], question: GapQuestion, progress: Progress) -> GapResult:
    rng = np.random.default_rng(question.seed)
    flights = sorted(
        distinctly_named(flights), key=content_hash
    )  # names and order of the files decide nothing
    prepared = _prepared(flights, question)
    progress("sensors")
    sensing = judge_sensing(prepared.records)
    corrected, strange = of_one_vehicle(apply_sensing(prepared.records, sensing), question.vehicle)
    if not corrected:
        reasons = "; ".join(f"{item.name}: {item.reason}" for item in (*sensing.broken, *strange))
        raise NothingToFindError(f"no flight can be used: {reasons}")
    check_motor_order(corrected, question.vehicle)
    fit_to, kept_back = split_flights(corrected)
    model = Model(question.vehicle, {}, _ceiling(question, corrected))
    training = training_set([corrected[i] for i in fit_to], model)
    found, names = concluded(model, training, [corrected[i] for i in kept_back], rng, progress)
    progress("flights that no fit saw")
    held_out = [corrected[i] for i in kept_back] or list(training.records)
    stages = _stages(names, held_out)
    own = own_floor(found.final, len(held_out))
    if reason := predicted_worse(names, stages, own, training.records):
        names = names.without_any(reason)
        stages = _stages(names, held_out)
    source = provenance(len(fit_to), len(kept_back), question.seed)
    believed = as_believed(found, names, training)
    nameless = nameless_curves(names, believed, [corrected[i] for i in kept_back], source)
    by_names = prediction_gap(stages)
    names, nameless = _with_curves(names, nameless, stages, held_out)
    unseen = HeldOutFlights(held_out)
    in_the_air = found_effects(names, unseen, rng)
    progress("landings")
    landings = _landings(flights, names, rng)
    effects = [
        *with_probability([*unsaid(sensing.effects, question.vehicle), *in_the_air], question.vehicle),
        *(landings.findings if landings else ()),
    ]
    progress("where it lives")
    maps = residual_map(found.first, training, rng), residual_map(believed, training, rng)
    chance = math.hypot(chance_floor(believed, training), own_floor(believed, len(held_out)))
    left = remaining(by_names, chance, believed, maps[1], question.vehicle, bool(effects))
    sizeable = with_consequence(found.unnamed, found.final, training)
    gap = prediction_gap(stages)
    improved = improved_vehicle(question.vehicle, effects, names, source)
    report = GapReport(
        verdict=_verdict(effects, sizeable, names, landings, left),
        vehicle=question.vehicle.name,
        effects=tuple(effects),
        gap=gap,
        where=where(maps[0]),
        unexplained=unexplained(sizeable, found.final, names, question.vehicle, left),
        nameless=nameless_terms(nameless, by_names, gap),
        train=tuple(record.name for record in training.records),
        held_out=tuple(corrected[i].name for i in kept_back),
        unusable=_unusable(question, prepared, (*sensing.broken, *strange)),
        ambiguous=_ambiguous(effects),
        rejected=tuple(
            Rejected(name=name, reason=reason)
            for name, reason in (found.refused | names.rejected).items()
            if name not in names.effects  # refused in one round, named in a later one
        ),
        limitations=(
            *prepared.limitations,
            *stages["before"].doubts(),
            *_limitations(kept_back, found, names, sensing, landings),
            *(no_better(stages, own, in_the_air) if kept_back else ()),
            *_negligible(found, sizeable),
            *_differing(found, names, training),
            *hard_to_fly(improved),
        ),
        landings=landings,
        seed=question.seed,
        settings=_settings(names.model),
        noise=_noise(found, training),
    )
    return GapResult(
        report=report,
        figures=figures(stages, names, held_out, found, training, maps),
        vehicle=improved,
        ceiling_z=names.model.ceiling_z,
    )


def _prepared(flights: Sequence[Flight], question: GapQuestion) -> PreparedFlights:
    prepared = prepare_flights(flights)
    if not prepared.records:
        refused = [(one.file, one.reason) for one in question.unusable]
        refused += [(str(one.file), one.reason) for one in prepared.refused]
        files: dict[str, list[str]] = {}
        for file, reason in refused:
            files.setdefault(reason, []).append(file)
        reasons = (
            reason if names[0] in reason else f"{', '.join(names)}: {reason}"
            for reason, names in files.items()
        )
        raise NothingToFindError(f"no usable flight: {'; '.join(reasons)}")
    return prepared


def _ceiling(question: GapQuestion, records: Sequence[FlightRecord]) -> float | None:
    """Height (m) of the ceiling: as asked, else as all records that know it agree on."""
    told = {record.ceiling_z for record in records if record.ceiling_z is not None}
    return question.ceiling_z if question.ceiling_z is not None or len(told) != 1 else told.pop()


def _verdict(
    effects: Sequence[FoundEffect],
    nameless: Sequence[FittedTerm],
    names: Named,
    landings: LandingFindings | None,
    left: Sequence[str],
) -> GapVerdict:
    odd_landings = landings is not None and landings.verdict is LandingVerdict.UNEXPLAINED_GAP
    if nameless or names.unconfirmed or odd_landings or left:
        return GapVerdict.UNEXPLAINED_GAP
    return GapVerdict.EFFECTS_FOUND if effects else GapVerdict.NO_GAP


def _ambiguous(effects: Sequence[FoundEffect]) -> tuple[AmbiguousSet, ...]:
    return tuple(
        AmbiguousSet(names=(effect.name, *effect.ambiguous_with), separated_by=effect.separated_by)
        for effect in effects
        if effect.ambiguous_with
    )


def _landings(flights: Sequence[Flight], names: Named, rng: np.random.Generator) -> LandingFindings | None:
    """What the landings say of legs and feet, with the effects that were found in the air."""
    landed = [flight for flight in flights if flight.trigger is not None]
    if not landed or names.model.base.legs is None:
        return None
    return judge_landings(landed, names.model.vehicle(), rng)


def _stages(names: Named, records: Sequence[FlightRecord]) -> dict[str, PredictionErrors]:
    """Predictions before, after each effect, and with all, on flights that no fit saw."""
    stages = {name: evaluate(records, model.vehicle()) for name, model in names.models().items()}
    if len(stages) == 1:
        stages["after"] = stages["before"]
    return stages


def _with_curves(
    names: Named, nameless: Nameless, stages: dict[str, PredictionErrors], records: Sequence[FlightRecord]
) -> tuple[Named, Nameless]:
    """The names with the curves, whose predictions are added to the stages; without them, where those are
    worse: nobody knows a physics that would speak for them."""
    if not nameless.curves:
        return names, nameless
    added = dataclasses.replace(names, curves=tuple(nameless.curves.values()))
    errors = evaluate(records, added.models()[NAMELESS].vehicle())
    *_, last = stages.values()
    if any(levels.after > levels.before for levels in acted_on(last, errors, added.curves)):
        return names, nameless.without_any(FAILED)
    stages.pop("after", None)  # where there are no names
    stages[NAMELESS] = errors
    return added, nameless


def _unusable(
    question: GapQuestion, prepared: PreparedFlights, not_used: Sequence[NotUsed]
) -> tuple[UnusableFile, ...]:
    refused = [UnusableFile(file=str(item.file), reason=item.reason) for item in prepared.refused]
    broken = [UnusableFile(file=item.name, reason=item.reason) for item in not_used]
    return (*question.unusable, *refused, *broken)


def _limitations(
    kept_back: Sequence[int],
    found: Search,
    names: Named,
    sensing: SensingFindings,
    landings: LandingFindings | None,
) -> tuple[str, ...]:
    limits = [
        f"{name} cannot be judged: even an ordinary one would not show; needed: {EFFECTS[name].revealed_by}"
        for name in found.blind
    ]
    limits += [
        f"{name} explains these flights best, but fewer than {FEWEST} were fitted: fly more to confirm it"
        for name in names.unconfirmed
    ]
    if found.first.model.ceiling_z is None and "ceiling_effect" in names.effects:
        limits.append(
            "ceiling_effect: nobody said how high the ceiling is; it was fitted at "
            f"{names.model.ceiling_z:.2f} m, and the parameters shift with it: give its height (--ceiling)"
        )
    limits += law_in_words(found.final)
    limits += sensing.notes
    if not found.final.estimate.fit.settled:
        limits.append(
            "how much flights differ by themselves (thrust, trims, battery) could not be found to the end: "
            "the intervals are those of the last step"
        )
    if landings is not None:
        limits += landings.limitations
    if not kept_back:
        limits.append(
            "no flight could be kept back, so the errors are on flights that were fitted: fly more, every "
            "important manoeuvre at least twice"
        )
    return tuple(limits)


def _negligible(found: Search, nameless: Sequence[FittedTerm]) -> list[str]:
    """Terms without a name that are no gap."""
    small = [one.term for one in found.unnamed if one not in nameless]
    words = formulas(found.final, small, found.final.model.base)
    return [f"{formula}: real, but without a name and too small to matter to a flight" for formula in words]


def _differing(found: Search, names: Named, training: Training) -> list[str]:
    """Named effects that one number does not tell for all flights."""
    flights = [record.name for record in training.records]
    return [
        in_words(one, found.final.model.rule(one.variable).unit, flights)
        for one in differing(found.final, names.effects)
    ]


def _settings(model: Model) -> dict[str, Any]:
    return {"ceiling_z_m": model.ceiling_z, "versions": {name: version(name) for name in _VERSIONS}}


def _noise(found: Search, training: Training) -> dict[str, Any]:
    estimate = found.final.estimate
    innovations = zip(CHANNELS, estimate.noise.sigma, UNITS, strict=True)
    own, of_flights = np.split(estimate.fit.spread, [len(NUISANCES)])
    spreads = zip(NUISANCES, own, strict=True)
    steady = zip((NUISANCES[index] for index in STEADY), of_flights, strict=True)
    return {
        "sample_interval_s": training.regression.signals.dt,
        "innovations": {name: {"sigma": float(s), "unit": unit} for name, s, unit in innovations},
        "between_parts_of_flights": {n.name: {"sigma": float(s), "unit": n.unit} for n, s in spreads},
        "between_flights": {n.name: {"sigma": float(s), "unit": n.unit} for n, s in steady},
        "log_timing_s": float(found.final.model.values.get(LOG_TIMING, 0.0)),
    }
