"""Choose the flight of the library that tells two effects apart best."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from calibration.gap.suggest.ambiguous import OpenQuestions
from calibration.gap.suggest.course import CourseDoesNotFit
from calibration.gap.suggest.landings import LANDINGS, landing_separation
from calibration.gap.suggest.manoeuvres import MANOEUVRES, manoeuvre
from calibration.gap.suggest.measurements import measurement_for
from calibration.gap.suggest.separation import Separation, separation
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Vehicle
from onboard.vehicle.effects import Domain

LEAST_OF_A_FLIGHT = 2.0
"""Log-likelihood ratio below which a flight tells nothing, however often it is flown: what is left then are
the model's own errors."""

WANTED = 30.0
"""Log-likelihood ratio that all flights together should have; a name needs 15 on flights that no fit saw."""

MOST_FLIGHTS = 8
LEAST_FLIGHTS = 3
"""Of one kind: with fewer nothing can be held out."""


@dataclass(frozen=True)
class Suggestion:
    """What to do about one pair of effects.

    Attributes:
        pair: the effects.
        flight: kind of the flight that separates them best, or None where none does.
        times: how often to fly it.
        ranking: every kind that fits the room, best first.
        measurement: on the ground, where no flight does.
    """

    pair: tuple[str, str]
    flight: str | None
    times: int
    ranking: tuple[tuple[str, Separation], ...]
    measurement: str | None

    def to_json(self) -> dict[str, object]:
        """By name."""
        return {
            "effects": list(self.pair),
            "flight": self.flight,
            "times": self.times,
            "measurement": self.measurement,
            "ranking": [
                {
                    "flight": kind,
                    "log_likelihood_ratio": found.log_likelihood_ratio,
                    "per_second": found.per_second,
                    "seconds": found.seconds,
                }
                for kind, found in self.ranking
            ],
        }


@dataclass(frozen=True)
class Search:
    """Where and with what to look.

    Attributes:
        vehicle: base vehicle.
        room: that the flights must fit.
        seed: of the disturbances.
        kinds: of flights to choose from.
        on_pair: called with each pair before it is looked at, for a display.
    """

    vehicle: Vehicle
    room: RoomGeometry
    seed: int = 0
    kinds: Sequence[str] = tuple(MANOEUVRES)
    on_pair: Callable[[tuple[str, str]], None] = lambda pair: None

    def suggest(self, questions: OpenQuestions) -> list[Suggestion]:
        """What to do about every pair of a report."""
        return [self._for_pair(questions, pair) for pair in questions.pairs]

    def _for_pair(self, questions: OpenQuestions, pair: tuple[str, str]) -> Suggestion:
        self.on_pair(pair)
        vehicle = questions.vehicle(self.vehicle)
        if any(EFFECTS[name].domain is Domain.CONTACT for name in pair):
            directed = {LANDINGS: self._landings(vehicle, questions, pair)}
        else:
            directed = self._courses(vehicle, questions, pair)
        ranking = sorted(directed.items(), key=lambda item: -item[1].per_second)
        telling = [item for item in ranking if item[1].log_likelihood_ratio >= LEAST_OF_A_FLIGHT]
        if not telling:
            return Suggestion(pair, None, 0, tuple(ranking), measurement_for(*pair))
        kind, best = telling[0]
        times = math.ceil(WANTED / best.log_likelihood_ratio)
        return Suggestion(pair, kind, min(max(times, LEAST_FLIGHTS), MOST_FLIGHTS), tuple(ranking), None)

    def _courses(
        self, vehicle: Vehicle, questions: OpenQuestions, pair: tuple[str, str]
    ) -> dict[str, Separation]:
        """Separation by every flight that fits the room: by the worse of the two directions."""
        found = {}
        for kind in self.kinds:
            try:
                course = manoeuvre(kind).course({}, self.room)
            except CourseDoesNotFit:
                continue
            found[kind] = _worse(
                [
                    separation(vehicle, questions.values_of(a), b, course, self.room, self.seed)
                    for a, b in (pair, pair[::-1])
                ]
            )
        return found

    def _landings(self, vehicle: Vehicle, questions: OpenQuestions, pair: tuple[str, str]) -> Separation:
        return _worse(
            [landing_separation(vehicle, questions.values_of(a), b, self.room) for a, b in (pair, pair[::-1])]
        )


def _worse(both: Sequence[Separation]) -> Separation:
    return min(both, key=lambda one: one.log_likelihood_ratio)
