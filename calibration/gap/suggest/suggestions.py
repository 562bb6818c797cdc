"""Choose the flight of the library that tells two effects apart best, or the measurement where none does."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial

import numpy as np

from calibration.gap.suggest.hypothesis import Hypothesis
from calibration.gap.suggest.landing_separation import LANDINGS, landing_separation
from calibration.gap.suggest.open_questions import OpenQuestions
from calibration.gap.suggest.separation import Separation, separation
from onboard.manoeuvres import MANOEUVRES, Course, CourseDoesNotFit, manoeuvre
from onboard.room import RoomGeometry
from onboard.vehicle import EFFECTS, Vehicle
from onboard.vehicle.effects import Domain


def measurement_for(first: str, second: str) -> str | None:
    """What decides between two effects on the ground, or None."""
    texts = dict.fromkeys(EFFECTS[name].measured_by for name in (second, first))
    return ", or ".join(filter(None, texts)) or None


LEAST_OF_A_FLIGHT = 2.0
"""Log-likelihood ratio below which a flight tells nothing, however often it is flown: what is left then are
the model's own errors."""

WANTED = 30.0
"""Log-likelihood ratio that all flights together should have; a name needs 15 on flights that no fit saw."""

MOST_FLIGHTS = 8
LEAST_FLIGHTS = 3
"""Of one kind: with fewer nothing can be held out."""


Directions = tuple[Separation, Separation]
"""The first effect true and the second fitted, and the other way round."""


@dataclass(frozen=True)
class Suggestion:
    """What to do about one pair of effects.

    Attributes:
        flight: kind of the flight that separates them best, or None where none does.
        ranking: every kind that fits the room, best first.
        advice: where no flight does: a measurement on the ground, or which effect to keep.
    """

    pair: tuple[str, str]
    flight: str | None
    times: int
    ranking: tuple[tuple[str, Separation], ...]
    advice: str | None

    def json_shape(self) -> dict[str, object]:
        """By name."""
        return {
            "effects": self.pair,
            "flight": self.flight,
            "times": self.times,
            "advice": self.advice,
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
class Suggester:
    """Where and with what to look.

    Attributes:
        room: that the flights must fit.
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
        first, second = (questions.values_of(name) for name in pair)

        def directions(tell: Callable[[Hypothesis, str], Separation]) -> Directions:
            return tell(first, pair[1]), tell(second, pair[0])

        if any(EFFECTS[name].domain is Domain.CONTACT for name in pair):
            directed = {LANDINGS: directions(partial(landing_separation, vehicle, room=self.room))}
        else:
            fly = partial(separation, vehicle, room=self.room, seed=self.seed)
            directed = {kind: directions(partial(fly, course=course)) for kind, course in self._courses()}
        ranking = sorted(
            ((kind, _worse(both)) for kind, both in directed.items()), key=lambda item: -item[1].per_second
        )
        telling = [item for item in ranking if item[1].log_likelihood_ratio >= LEAST_OF_A_FLIGHT]
        if not telling:
            # Each is measured by means of its own (a mass, a thrust): one need not be kept.
            by_means = len({EFFECTS[name].measured_by for name in pair} - {""}) == len(pair)
            contained = None if by_means else _imitation(pair, directed.values())
            advice = contained or measurement_for(*pair)
            return Suggestion(pair, None, 0, tuple(ranking), advice)
        kind, best = telling[0]
        times = math.ceil(WANTED / best.log_likelihood_ratio)
        return Suggestion(pair, kind, min(max(times, LEAST_FLIGHTS), MOST_FLIGHTS), tuple(ranking), None)

    def _courses(self) -> Iterator[tuple[str, Course]]:
        """Every flight that fits the room."""
        for kind in self.kinds:
            with suppress(CourseDoesNotFit):
                yield kind, manoeuvre(kind).course({}, self.room)


def _worse(both: Directions) -> Separation:
    return min(both, key=lambda one: one.log_likelihood_ratio)


def _imitation(pair: tuple[str, str], found: Iterable[Directions]) -> str | None:
    """What to do where one effect contains the other: flights can show that it is needed, never that not."""
    best = np.max([[one.log_likelihood_ratio for one in both] for both in found], axis=0)
    able = best >= LEAST_OF_A_FLIGHT
    if able[0] == able[1]:
        return None
    simpler, richer = pair if able[1] else pair[::-1]
    return f"{richer} can do all that {simpler} does: keep {simpler}, the simpler of the two"
