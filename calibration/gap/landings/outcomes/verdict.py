"""What predicted and real outcomes say of a vehicle file: what it lacks, what the flights leave open."""

import dataclasses
import math

from calibration.gap.data.found_effect import Verdict
from calibration.gap.landings.outcomes.scores import Score, count_interval
from calibration.gap.landings.outcomes.search import GROUPS, LAWS, OutcomeSearch
from calibration.gap.landings.outcomes.vehicles import EFFECT_OF, UNITS, stripped
from onboard.arrays import FloatArray
from onboard.quantity import Quantity
from onboard.vehicle import Effect, Vehicle

LEVEL = 1.0 - 0.05 / 3.0
"""Of the intervals of three counts, one of which lies outside in at most 5 % where the model is right."""


def judge_outcomes(score: Score | None, probability: FloatArray, search: OutcomeSearch | None) -> Verdict:
    """The verdict.

    `score` and `probability` (of four, two, none, (n, 3)) are of the classified flights.
    """
    if score is None:
        return Verdict.CANNOT_TELL
    if search is not None and search.named:
        return Verdict.EFFECTS_FOUND
    intervals = [count_interval(shares, LEVEL) for shares in probability.T]
    expected = all(
        low <= count.real <= high for count, (low, high) in zip(score.counts.values(), intervals, strict=True)
    )
    return Verdict.NO_GAP if expected else Verdict.UNEXPLAINED_GAP


def in_words(verdict: Verdict, score: Score, search: OutcomeSearch | None) -> tuple[str, ...]:
    """What a lab is told, a sentence a line."""
    flights = f"{score.flights} flights"
    if verdict is Verdict.EFFECTS_FOUND and search is not None:
        left = ", ".join(search.left_open)
        open_ones = (f"what {flights} cannot tell: {left}",) if left else ()
        return (*(_lacks(search, group) for group in search.named), *open_ones)
    if verdict is Verdict.NO_GAP:
        beside = (
            ""
            if all(count.inside for count in score.counts.values())
            else (
                f" (all within {LEVEL:.0%}; a right model misses one of three 80 % intervals every other day)"
            )
        )
        return (
            f"no gap that {flights} can show: four, two and none happened about as often as expected{beside}",
        )
    often = ", ".join(
        f"{word} {one.real} (expected {one.expected:.1f})" for word, one in score.counts.items()
    )
    why = "look for what is missing with --search" if search is None else "no known effect explains it"
    return (f"the simulation is wrong about these landings: {often}; {why}",)


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
