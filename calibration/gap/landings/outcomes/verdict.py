"""What predicted and real outcomes say of a vehicle file: what it lacks, what the flights leave open."""

import dataclasses
import math
from collections.abc import Iterator

from calibration.gap.data.found_effect import Verdict
from calibration.gap.landings.outcomes.scores import Score
from calibration.gap.landings.outcomes.search import GROUPS, LAWS, OutcomeSearch
from calibration.gap.landings.outcomes.vehicles import EFFECT_OF, UNITS, stripped
from calibration.gap.landings.outcomes.words import between, percent
from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle

LEVEL = 0.05
"""Probability at most that a right model is called wrong."""

COUNT_LEVEL = 0.5 * LEVEL / 3.0
"""Of each of the three counts: half of the level is for the totals,"""

FLIGHTS_LEVEL = 0.5 * LEVEL
"""and half for the score of the single flights."""

COMMAND = "gap landings"
"""The source of a number that was found in landings names it."""

ENOUGH = 15
"""Flights: fewer show gross errors only (docs/gap_landings_judged.md)."""


def judge_outcomes(score: Score | None, search: OutcomeSearch | None) -> Verdict:
    """The verdict, from the score of the vehicle as filed on the classified flights."""
    if score is None:
        return Verdict.CANNOT_TELL
    if search is not None and search.named:
        return Verdict.EFFECTS_FOUND
    return Verdict.UNEXPLAINED_GAP if _totals_wrong(score) or _flights_wrong(score) else Verdict.NO_GAP


def _totals_wrong(score: Score) -> bool:
    """Whether four, two or none happened another number of times than the model can expect."""
    return any(count.p_value <= COUNT_LEVEL for count in score.counts.values())


def _flights_wrong(score: Score) -> bool:
    """Whether the probabilities of the flights score worse than they can expect of themselves."""
    return score.brier_if_right.p_value <= FLIGHTS_LEVEL


def in_words(verdict: Verdict, score: Score, search: OutcomeSearch | None) -> tuple[str, ...]:
    """What a lab is told, a sentence a line."""
    flights = f"{score.flights} flights"
    if verdict is Verdict.EFFECTS_FOUND and search is not None:
        left = ", ".join(search.left_open)
        open_ones = (f"what {flights} cannot tell: {left}",) if left else ()
        return (*(_lacks(search, group) for group in search.named), *open_ones)
    if verdict is Verdict.NO_GAP:
        return (_no_gap(score),)
    why = "look for what is missing with --search" if search is None else "no known effect explains it"
    return tuple(_disagreements(score, why))


def _no_gap(score: Score) -> str:
    """What so many flights could have shown and did not."""
    beside = (
        ""
        if all(count.inside for count in score.counts.values())
        else (
            f" (all within {percent(1.0 - COUNT_LEVEL)}; a right model misses one of three 80 % intervals "
            "every other day)"
        )
    )
    few = score.flights < ENOUGH
    shown = f", and fewer than {ENOUGH} show gross errors only" if few else ""
    often = "as often as chance allows" if few else "about as often as expected"
    scored = "no worse than probabilities that are right may" if few else "as probabilities that are right do"
    return (
        f"no gap that {score.flights} flights can show{shown}: four, two and none happened {often}{beside}, "
        f"and the single flights score {scored}{_against_base_rate(score)}"
    )


def _against_base_rate(score: Score) -> str:
    """What is not shown of the probabilities, though they may be right."""
    if score.brier_gain_ci95 is None:
        return "; all ended alike, which no base rate can be compared on"
    low, high = score.brier_gain_ci95
    if low > 0.0:
        return "; always guessing the base rate is better"
    return "; no better than always guessing the base rate is shown" if high >= 0.0 else ""


def _disagreements(score: Score, why: str) -> Iterator[str]:
    """What of the simulation is wrong: how many flights end how, or which."""
    wrong = _totals_wrong(score)
    if wrong:
        often = ", ".join(
            f"{word} {one.real} (expected {one.expected:.1f})" for word, one in score.counts.items()
        )
        yield f"the simulation is wrong about these landings: {often}; {why}"
    if _flights_wrong(score):
        right = score.brier_if_right
        which = (
            "the simulation is wrong about single flights, too"
            if wrong
            else "the simulation expects about as many of each as there were, but of other flights"
        )
        yield (
            f"{which}: Brier {score.brier:.2f}, where probabilities that are right get {right.mean:.2f}"
            f"{between(right.ci95)} and one as bad in {percent(right.p_value)}; hold "
            "labels, triggers and ceilings of the flights that it was sure of against the records"
            f"{'' if wrong else f'; {why}'}"
        )


def _lacks(search: OutcomeSearch, group: str) -> str:
    said = []
    for coordinate in GROUPS[group]:
        effect, parameter = EFFECT_OF[coordinate]
        found = search.values[coordinate]
        unit = "" if UNITS[coordinate] == "1" else f" {UNITS[coordinate]}"
        filed = f"filed {getattr(search.filed, coordinate):g}"
        if found.at_bound:
            ends = " and ".join(f"{end:.3g}" for end in found.ends)
            filed += f"; runs to {ends}, the end of what was tried: it may lie beyond"
        said.append(f"{effect}.{parameter} {found.mean:.3g} +- {found.sigma:.2g}{unit} ({filed})")
    told = f"{', '.join(said)}; Brier {search.gains[group].brier:+.2f}"
    return f"the vehicle file is wrong about its {group}: {told}"


def found_in_landings(vehicle: Vehicle) -> Iterator[str]:
    """What a lab is told where the file says that effects of the vehicle come from this command."""
    sources: dict[str, list[str]] = {}
    for effect in vehicle.effects:
        for name, one in effect.parameters.items():
            if COMMAND in one.source:
                sources.setdefault(one.source, []).append(f"{effect.name}.{name}")
    if sources:
        named = "; ".join(f"{', '.join(names)}: {source}" for source, names in sources.items())
        yield (
            f"numbers of this vehicle were found in landings ({named}): if these are the same flights, "
            "scores, verdict and intervals are in sample"
        )


def improved_vehicle(vehicle: Vehicle, search: OutcomeSearch, source: str) -> Vehicle:
    """The vehicle with what the best model found, which fits together; other effects as filed.

    The standard deviation of what is named is that about its value here over all models. What goes with a
    named group in the best model and has no name of its own is written too, and says so. A law of pads that
    is found stands in place of those that were filed.

    Args:
        vehicle: as given. search: with at least one named group. source: provenance of the numbers.
    """
    found: dict[str, dict[str, Quantity]] = {}
    for group in search.best.groups:
        origin = source if group in search.named else f"{source}; goes with it, not told from what was filed"
        for coordinate in GROUPS[group]:
            effect, parameter = EFFECT_OF[coordinate]
            own = search.best.values[coordinate]
            sigma, ends = own.sigma, own.ends
            if coordinate in search.values:  # which models the flights leave open makes it less certain
                over_all = search.values[coordinate]
                sigma, ends = math.hypot(over_all.sigma, over_all.mean - own.mean), (*ends, *over_all.ends)
            told = f"{origin}; at the end of what was tried, may lie beyond" if ends else origin
            found.setdefault(effect, {})[parameter] = Quantity(own.mean, UNITS[coordinate], sigma, told)
    groups = (*search.best.groups, *(LAWS if set(LAWS) & set(search.best.groups) else ()))
    kept = stripped(vehicle.effects, [name for group in groups for name in GROUPS[group]])
    effects = {effect.name: dict(effect.parameters) for effect in kept}
    for name, parameters in found.items():
        effects[name] = {**effects.pop(name, {}), **parameters}
    made = tuple(Effect(name=name, parameters=parameters) for name, parameters in effects.items())
    return dataclasses.replace(vehicle, effects=made)
