"""Find the gap: sensors first, then the missing effects, then the proof on flights that no fit saw."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from typing import Any

import numpy as np

from calibration.errors import CalibrationError
from calibration.flights import Flight
from calibration.gap.data import PreparedFlights, prepare_flights
from calibration.gap.data.duplicates import content_hash
from calibration.gap.data.found_effect import FoundEffect, Verdict
from calibration.gap.data.names import distinctly_named
from calibration.gap.data.record import FlightRecord, NotUsed
from calibration.gap.data.signals import CHANNELS, UNITS
from calibration.gap.data.split import split_flights
from calibration.gap.data.under_ceiling import under_ceiling
from calibration.gap.estimate.model import Model
from calibration.gap.estimate.nuisances import NUISANCES, STEADY
from calibration.gap.estimate.refine import Training, training_set
from calibration.gap.estimate.voltage_lag import voltage_lag
from calibration.gap.landings import LandingFindings, judge_landings
from calibration.gap.replay.hover_voltage import of_one_vehicle
from calibration.gap.replay.motor_order import check_motor_order
from calibration.gap.replay.touching import clear_of_floor
from calibration.gap.report.confidence import with_probability
from calibration.gap.report.document import (
    AmbiguousSet,
    GapReport,
    Rejected,
)
from calibration.gap.report.figures import figures, unexplained, unnamed_in_report, where
from calibration.gap.report.figures_data import ReportFigures
from calibration.gap.report.improved_vehicle import hard_to_fly, improved_vehicle, provenance
from calibration.gap.report.predicted_worse import no_better
from calibration.gap.report.prediction_figures import prediction_gap
from calibration.gap.report.proof import Proof, proof
from calibration.gap.report.remaining import chance_floor, own_floor, remaining
from calibration.gap.report.reservations import (
    of_one_number_for_all,
    of_small_terms,
    of_the_fit,
    of_the_search,
    of_the_voltage,
)
from calibration.gap.search.always import LOG_TIMING
from calibration.gap.search.conclusion import concluded
from calibration.gap.search.forward import Search
from calibration.gap.search.naming import Named
from calibration.gap.search.selection import Progress
from calibration.gap.sensors import SensingFindings, apply_sensing, judge_sensing, unsaid
from calibration.gap.unnamed.fitted_terms import FittedTerm, residual_map, with_consequence
from calibration.gap.unnamed.gap_map import GapMap
from onboard.checked_arguments import checked_count
from onboard.errors import InputError
from onboard.linear_algebra import on_one_thread
from onboard.room import ceiling_height
from onboard.vehicle import Vehicle


class NothingToFindError(CalibrationError, InputError):
    """Not one flight can be held against a model; the message says why."""


_VERSIONS = ("perchhw", "numpy", "scipy", "numba")
"""Packages whose next version may give other last digits."""


@dataclass(frozen=True)
class GapResult:
    """What was found.

    Attributes:
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
        ceiling_z: m, height of the ceiling, if known.
        unusable: files that were refused on reading.
    """

    vehicle: Vehicle
    seed: int = 0
    ceiling_z: float | None = None
    unusable: Sequence[NotUsed] = field(default=())

    def __post_init__(self) -> None:
        """Refuse what cannot be asked, and make numbers of numpy plain ones, as the report has them.

        Raises:
            CeilingError: there is no such ceiling.
            ArgumentError: the seed is none.
        """
        object.__setattr__(self, "seed", checked_count(self.seed, "seed"))
        if self.ceiling_z is not None:
            object.__setattr__(self, "ceiling_z", ceiling_height(self.ceiling_z))


@dataclass(frozen=True, kw_only=True)
class _Flown:
    """The flights as a search gets them.

    Attributes:
        prepared: as read, with what cannot be concluded from them.
        not_used: those that were left out after that, with the reason.
        to_fit, kept_back: the others, the latter for the proof; none of few flights.
    """

    prepared: PreparedFlights
    sensing: SensingFindings
    not_used: Sequence[NotUsed]
    to_fit: Sequence[FlightRecord]
    kept_back: Sequence[FlightRecord]
    ceiling_z: float | None


@dataclass(frozen=True, kw_only=True)
class _Examined:
    """What the flights gave, step by step.

    Attributes:
        proved: what flights that no fit saw leave of it.
        of_flights: effects of the sensors, then of body, motors and air.
        maps: where the gap lived before anything was added, and where the rest lives.
    """

    flown: _Flown
    training: Training
    found: Search
    proved: Proof
    of_flights: Sequence[FoundEffect]
    landings: LandingFindings | None
    maps: tuple[GapMap, GapMap]

    @property
    def of_landings(self) -> tuple[FoundEffect, ...]:
        """What landings show."""
        return self.landings.findings if self.landings else ()


@on_one_thread()  # flights are in parallel already
def find_gap(
    flights: Sequence[Flight], question: GapQuestion, progress: Progress = lambda _: None
) -> GapResult:
    """Find what a vehicle file lacks; flights with a trigger are looked at for their landings, too.

    Raises:
        NothingToFindError: not one flight can be used.
        CeilingError: a flight goes clearly above the ceiling that was asked for.
    """
    # Names and order of the files decide nothing.
    flights = sorted(distinctly_named(flights), key=content_hash)
    flown = _flown(flights, question, progress)
    source = provenance(len(flown.to_fit), len(flown.kept_back), question.seed)
    examined = _examined(flights, flown, question, source, progress)
    proved = examined.proved
    effects = (*examined.of_flights, *examined.of_landings)
    improved = improved_vehicle(question.vehicle, effects, proved.names, source)
    return GapResult(
        report=_report(examined, question, improved),
        figures=figures(
            proved.stages, proved.names, proved.held_out, examined.found, examined.training, examined.maps
        ),
        vehicle=improved,
        ceiling_z=proved.names.model.ceiling_z,
    )


def _flown(flights: Sequence[Flight], question: GapQuestion, progress: Progress) -> _Flown:
    prepared = _prepared(flights, question)
    progress("sensors")
    sensing = judge_sensing(prepared.records)
    corrected, strange = of_one_vehicle(apply_sensing(prepared.records, sensing), question.vehicle)
    not_used = (*sensing.broken, *strange)
    if not corrected:
        reasons = "; ".join(f"{item.name}: {item.reason}" for item in not_used)
        raise NothingToFindError(f"no flight can be used: {reasons}")
    check_motor_order(corrected, question.vehicle)
    ceiling = _ceiling(corrected)
    corrected = clear_of_floor([record.under(ceiling) for record in corrected], question.vehicle)
    to_fit, kept_back = split_flights(corrected)
    lag = voltage_lag([corrected[i] for i in to_fit], Model(question.vehicle, {}, ceiling))
    corrected = [replace(record, voltage_lag=lag) for record in corrected]
    return _Flown(
        prepared=prepared,
        sensing=sensing,
        not_used=not_used,
        to_fit=[corrected[i] for i in to_fit],
        kept_back=[corrected[i] for i in kept_back],
        ceiling_z=ceiling,
    )


def _examined(
    flights: Sequence[Flight], flown: _Flown, question: GapQuestion, source: str, progress: Progress
) -> _Examined:
    rng = np.random.default_rng(question.seed)
    model = Model(question.vehicle, {}, flown.ceiling_z)
    training = training_set(flown.to_fit, model)
    found, names = concluded(model, training, flown.kept_back, rng, progress)
    progress("flights that no fit saw")
    proved = proof(found, names, training, flown.kept_back, source, rng)
    progress("landings")
    landings = _landings(flights, proved.names, rng)
    progress("where it lives")
    return _Examined(
        flown=flown,
        training=training,
        found=found,
        proved=proved,
        of_flights=(*unsaid(flown.sensing.effects, question.vehicle), *proved.effects),
        landings=landings,
        maps=(residual_map(found.first, training, rng), residual_map(proved.believed, training, rng)),
    )


def _report(examined: _Examined, question: GapQuestion, improved: Vehicle) -> GapReport:
    flown, training = examined.flown, examined.training
    found, proved, (first_map, last_map) = examined.found, examined.proved, examined.maps
    believed, names = proved.believed, proved.names
    chance = math.hypot(chance_floor(believed, training), own_floor(believed, len(proved.held_out)))
    named = bool(examined.of_flights or examined.of_landings)
    left = (
        *flown.sensing.unexplained,
        *remaining(proved.by_names, chance, believed, last_map, question.vehicle, named),
    )
    sizeable = with_consequence(found.unnamed, found.final, training)
    explained = not (sizeable or names.unconfirmed or left)
    of_flights = with_probability(examined.of_flights, question.vehicle, explained)
    effects = (*of_flights, *examined.of_landings)
    gap = prediction_gap(proved.stages)
    return GapReport(
        verdict=_verdict(effects, explained, examined.landings),
        vehicle=question.vehicle.name,
        effects=tuple(effects),
        gap=gap,
        where=where(first_map),
        unexplained=unexplained(sizeable, found.final, names, question.vehicle, left),
        nameless=unnamed_in_report(proved.unnamed, proved.by_names, gap),
        train=tuple(record.name for record in flown.to_fit),
        held_out=tuple(record.name for record in flown.kept_back),
        unusable=(*question.unusable, *_refused(flown.prepared), *flown.not_used),
        ambiguous=_ambiguous(effects),
        rejected=tuple(
            Rejected(name=name, reason=reason)
            for name, reason in (found.refused | names.rejected).items()
            if name not in names.effects  # refused in one round, named in a later one
        ),
        limitations=(*_limitations(examined, sizeable), *hard_to_fly(improved)),
        landings=examined.landings,
        seed=question.seed,
        settings={
            "ceiling_z_m": names.model.ceiling_z,
            "versions": {name: version(name) for name in _VERSIONS},
        },
        noise=_noise(found, training),
    )


def _prepared(flights: Sequence[Flight], question: GapQuestion) -> PreparedFlights:
    prepared = prepare_flights(flights)
    if not prepared.records:
        files: dict[str, list[str]] = {}
        for one in (*question.unusable, *_refused(prepared)):
            files.setdefault(one.reason, []).append(one.name)
        reasons = (
            reason if names[0] in reason else f"{', '.join(names)}: {reason}"
            for reason, names in files.items()
        )
        raise NothingToFindError(f"no usable flight: {'; '.join(reasons) or 'none was given'}")
    if question.ceiling_z is None:
        return prepared
    return replace(prepared, records=tuple(under_ceiling(prepared.records, question.ceiling_z)))


def _ceiling(records: Sequence[FlightRecord]) -> float | None:
    """Height (m) of the ceiling, as all records that know it agree on."""
    told = {record.ceiling_z for record in records if record.ceiling_z is not None}
    return told.pop() if len(told) == 1 else None


def _verdict(effects: Sequence[FoundEffect], explained: bool, landings: LandingFindings | None) -> Verdict:
    odd_landings = landings is not None and landings.verdict is Verdict.UNEXPLAINED_GAP
    if odd_landings or not explained:
        return Verdict.UNEXPLAINED_GAP
    return Verdict.EFFECTS_FOUND if effects else Verdict.NO_GAP


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


def _refused(prepared: PreparedFlights) -> list[NotUsed]:
    return [NotUsed(str(item.file), item.reason) for item in prepared.refused]


def _limitations(examined: _Examined, sizeable: Sequence[FittedTerm]) -> Iterator[str]:
    flown, found, proved = examined.flown, examined.found, examined.proved
    yield from flown.prepared.limitations
    yield from proved.stages["before"].doubts()
    yield from of_the_search(found, proved.names)
    yield from flown.sensing.notes
    if examined.landings is not None:
        yield from examined.landings.limitations
    yield from of_the_fit(found, flown.kept_back)
    yield from of_the_voltage(examined.training)
    if flown.kept_back:
        yield from no_better(proved.stages, proved.own, proved.effects)
    yield from of_small_terms(found, sizeable)
    yield from of_one_number_for_all(found, proved.names, examined.training)


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
