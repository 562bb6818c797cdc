"""What ``perchhw gap landings`` says: predicted and real outcomes, flight by flight, and their score."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calibration.errors import CalibrationError
from calibration.gap.data.found_effect import Verdict
from calibration.gap.data.record import NotUsed
from calibration.gap.landings.outcomes.body_contact import ContactScore, contact_score, touched
from calibration.gap.landings.outcomes.dispersion import MeasuredLaunch, measured_launch
from calibration.gap.landings.outcomes.expectation import JudgedExpectation, judged_expectation
from calibration.gap.landings.outcomes.labels import CLASS_NAMES, FOUR, LABELS_FILE, landing_class
from calibration.gap.landings.outcomes.nested import NestedScore, nested_score
from calibration.gap.landings.outcomes.predict import OutcomeForecast
from calibration.gap.landings.outcomes.prepare import CLOCK_BOUND, PreparedLandings, roll_errors
from calibration.gap.landings.outcomes.scores import Score, score
from calibration.gap.landings.outcomes.search import LEAST_NAMING, OutcomeSearch, search_outcomes
from calibration.gap.landings.outcomes.tables import tabulate
from calibration.gap.landings.outcomes.vehicles import bare_parameters, filed_point, grid
from calibration.gap.landings.outcomes.verdict import (
    COMMAND,
    found_in_landings,
    improved_vehicle,
    in_words,
    judge_outcomes,
)
from onboard.arrays import IntArray
from onboard.errors import InputError
from onboard.outcome import Outcome
from onboard.vehicle import Vehicle, vehicle_to_toml
from onboard.vehicle.fingerprint import fingerprint

SCHEMA = "perchhw.gap_landings/1"

LEAST_FLIGHTS = 4
"""Fewer classified flights have no score."""


class TooFewFlightsError(CalibrationError, InputError):
    """A search needs more classified flights."""


@dataclass(frozen=True)
class ImprovedVehicle:
    """The vehicle with what a search found.

    Attributes:
        vehicle: as it is written.
        expectation: of more flights like these, with this vehicle: from what its model says of each flight
            without having seen it.
    """

    vehicle: Vehicle
    expectation: JudgedExpectation

    def json_shape(self) -> dict[str, Any]:
        """As a JSON object."""
        return {"vehicle_sha256": _sha256(self.vehicle), "expectation": self.expectation}


@dataclass(frozen=True)
class LandingReport:
    """Predictions beside what happened.

    Attributes:
        vehicle: the model. seed: of the draws.
        prepared: the flights. forecast: what the vehicle expects of them, in the same order.
        real: outcome of each, None where nobody classified it. labelled: which of them people wrote down.
        score: of the classified ones; None when there are fewer than LEAST_FLIGHTS.
        contact_score: of body contact, of the flights of which it is known; None likewise.
        expectation: of more flights like these, with this vehicle; None likewise.
        unused: flights that are not judged.
        search: which effects are missing; None: not asked.
        nested: score of the search, its model chosen without the flights that it predicts; None likewise.
        improved: the vehicle with what the search named; None where it named nothing.
    """

    vehicle: Vehicle
    seed: int
    prepared: PreparedLandings
    forecast: OutcomeForecast
    real: tuple[Outcome | None, ...]
    labelled: tuple[bool, ...]
    score: Score | None
    contact_score: ContactScore | None
    expectation: JudgedExpectation | None
    unused: tuple[NotUsed, ...]
    search: OutcomeSearch | None = None
    nested: NestedScore | None = None
    improved: ImprovedVehicle | None = None

    @property
    def launch(self) -> MeasuredLaunch | None:
        """How approaches differ from what they were told."""
        ready = self.prepared
        return measured_launch(ready.starts, ready.measured_ceilings, ready.dispersion.height)

    @property
    def verdict(self) -> Verdict:
        """What the outcomes say of the vehicle."""
        return judge_outcomes(self.score, self.search)

    @property
    def words(self) -> tuple[str, ...]:
        """The verdict for people and what it rests on, a sentence a line."""
        return (*self._verdict_words, *found_in_landings(self.vehicle), *self._doubts)

    @property
    def _verdict_words(self) -> tuple[str, ...]:
        if self.score is None:
            rows, _ = classified(self.real)
            return (
                f"cannot tell: {rows.size} of {len(self.real)} flights are classified, and a score needs "
                f"{LEAST_FLIGHTS}: add flights, or write what happened into labels.csv (file,outcome) beside "
                "them",
            )
        return in_words(self.verdict, self.score, self.search)

    @property
    def _doubts(self) -> Iterator[str]:
        """Whose word the outcomes are, and flights whose time is not known."""
        written = sum(self.labelled)
        known = sum(real is not None for real in self.real)
        rest = f", {len(self.real) - known} unknown" if known < len(self.real) else ""
        yield f"outcomes: {written} from {LABELS_FILE}, {known - written} from the flights' own data{rest}"
        late = [
            start.name
            for start, flip in zip(self.prepared.starts, self.prepared.flips, strict=True)
            if flip.clock_at_bound
        ]
        if late:
            yield (
                f"the flip of {len(late)} of {len(self.real)} flights is {1e3 * CLOCK_BOUND:.0f} ms or more "
                f"beside its trigger ({', '.join(late)}): look at the clocks of trigger and gyro, "
                "or the flip of this vehicle file is wrong; their ceiling and time of contact are not to be "
                "trusted"
            )
        yield from (one.words for one in self.prepared.unknown_ceilings)

    @property
    def prospects(self) -> tuple[str, ...]:
        """What to expect of more flights, for people: of the vehicle as it is, and as it is written."""
        if self.expectation is None:
            return ()
        if self.improved is None:
            return (self.expectation.words,)
        return (
            f"as filed: {self.expectation.words}",
            f"with what was found: {self.improved.expectation.words}",
        )

    def json_shape(self) -> dict[str, Any]:
        """The document ``perchhw.gap_landings/1``."""
        flips = self.prepared.flips
        missed, left = roll_errors(flips).T
        return {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "says": self.words,
            "vehicle": self.vehicle.name,
            "vehicle_sha256": _sha256(self.vehicle),
            "seed": self.seed,
            "draws": self.forecast.draws,
            "flights": [self._flight(index) for index in range(len(self.real))],
            "score": self.score,
            "body_contact_score": self.contact_score,
            "expectation": self.expectation,
            "improved": self.improved,
            "dispersion": self.prepared.dispersion,
            "launch": self.launch,
            "unknown_ceilings": self.prepared.unknown_ceilings,
            "flip": {
                "pitch_rate_rms_rad_s": _rms([flip.error for flip in flips]),
                "pitch_slope": _mean([flip.pitch for flip in flips]),
                "roll_per_pitch": _mean([flip.roll for flip in flips]),
                "roll_rate_rms_rad_s": _rms(missed),
                "roll_rate_rms_with_it_rad_s": _rms(left),
                "roll": self.prepared.roll,
            },
            **self._searched(),
            "unusable": self.unused,
        }

    def _searched(self) -> dict[str, Any]:
        if self.search is None:
            return {"effects": None}
        found = self.search.json_shape()
        return {**found, "search": {**found["search"], "nested": self.nested}}

    def _flight(self, index: int) -> dict[str, Any]:
        flight, real = self.forecast.flights[index], self.real[index]
        shares = {f"p_{name}": float(p) for name, p in zip(CLASS_NAMES, flight.probability, strict=True)}
        return {
            "name": flight.name,
            "real": None if real is None else real.value,
            "real_from": None if real is None else LABELS_FILE if self.labelled[index] else "flight",
            **shares,
            "p_body_contact": flight.body_contact,
            "p_body_contact_if_held": flight.body_contact_held,
            "ceiling_m": float(self.prepared.ceilings[index]),
            "ceiling_contacts": int(self.prepared.contacts[index]),
            "contact_s": flight.contact,
            "contact_measured_s": flight.measured_contact,
        }


def landing_report(
    prepared: PreparedLandings,
    found: OutcomeForecast,
    real: Sequence[Outcome | None],
    labelled: Sequence[bool],
    vehicle: Vehicle,
    seed: int,
    unreadable: Sequence[NotUsed] = (),
    shows_contact: Sequence[bool] | None = None,
) -> LandingReport:
    """Score a forecast.

    Args:
        prepared: the flights. found: what the model expects of them.
        real: outcomes in the order of the starts. labelled: which of them people wrote down.
        vehicle: the model. seed: of the draws; the bootstrap has a stream of its own.
        unreadable: files that hold no flight.
        shows_contact: of which the outcome tells body contact where a leg holds; default: of those
            that people wrote down.
    """
    rows, known = classified(real)
    scored = expected = None
    if rows.size >= LEAST_FLIGHTS:
        shares = found.probability[rows]
        scored = score(shares, known, found.draws, np.random.default_rng([seed, 1]))
        expected = judged_expectation(shares[:, FOUR], known == FOUR, np.random.default_rng([seed, 3]))
    shown = labelled if shows_contact is None else shows_contact
    contact = [touched(one) if shows else None for one, shows in zip(real, shown, strict=True)]
    return LandingReport(
        vehicle=vehicle,
        seed=seed,
        prepared=prepared,
        forecast=found,
        real=tuple(real),
        labelled=tuple(labelled),
        score=scored,
        contact_score=contact_score(found.flights, contact, LEAST_FLIGHTS, np.random.default_rng([seed, 4])),
        expectation=expected,
        unused=(*unreadable, *prepared.unused),
    )


def classified(real: Sequence[Outcome | None]) -> tuple[IntArray, IntArray]:
    """Indices (k,) of the flights that have a class, and their classes (k,)."""
    classes = [None if outcome is None else landing_class(outcome) for outcome in real]
    rows = [index for index, one in enumerate(classes) if one is not None]
    return np.array(rows, dtype=np.int64), np.array([classes[row] for row in rows], dtype=np.int64)


def require_searchable(real: Sequence[Outcome | None]) -> None:
    """Refuse flights of which too few are classified to name what the vehicle lacks.

    Raises:
        TooFewFlightsError: fewer than LEAST_NAMING.
    """
    rows, _ = classified(real)
    if rows.size < LEAST_NAMING:
        raise TooFewFlightsError(
            f"{rows.size} classified flights with a trigger: a name needs at least {LEAST_NAMING}; add "
            "flights, or classify them in labels.csv, or leave out --search: the vehicle as filed is judged "
            f"by {LEAST_FLIGHTS}"
        )


def search_report(report: LandingReport, progress: Callable[[float], None] = lambda _: None) -> LandingReport:
    """The report with a search for what the vehicle lacks.

    `progress` is called with the share done, 0..1.

    Raises:
        TooFewFlightsError: fewer.
    """
    require_searchable(report.real)
    rows, known = classified(report.real)
    filed = filed_point(report.vehicle)
    bare = bare_parameters(report.vehicle)
    points = grid(bare, filed)
    table = tabulate(report.prepared, bare, points, progress)[:, rows]
    rng = np.random.default_rng([report.seed, 2])
    found = search_outcomes(points, table, known, report.forecast.draws, rng, filed)
    again = np.random.default_rng([report.seed, 6])
    nested = nested_score(found, points, table, known, report.forecast.draws, again, filed)
    return replace(report, search=found, nested=nested, improved=_improved(report, found, known))


def _improved(report: LandingReport, found: OutcomeSearch, known: IntArray) -> ImprovedVehicle | None:
    """With what to expect of it: what flights say of the vehicle as filed is no error of this one."""
    if not found.named:
        return None
    source = f"{COMMAND}: outcomes of {known.size} flights, seed {report.seed}"
    expected = judged_expectation(
        found.best.left_out[:, FOUR], known == FOUR, np.random.default_rng([report.seed, 5])
    )
    return ImprovedVehicle(improved_vehicle(report.vehicle, found, source), expected)


def _sha256(vehicle: Vehicle) -> str:
    return fingerprint(vehicle_to_toml(vehicle))


def _rms(values: Iterable[float]) -> float | None:
    square = _mean(np.square([*values]))
    return None if square is None else float(np.sqrt(square))


def _mean(values: Iterable[float]) -> float | None:
    known = np.array([value for value in values if np.isfinite(value)])
    return float(np.mean(known)) if known.size else None
