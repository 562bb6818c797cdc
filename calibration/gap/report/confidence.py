"""How probable it is that a name is right, by what became of names that were as clear in random draws.

A likelihood says how sure a model is of a number, if the model is right. Whether the name is right, programs
that share nothing with the finder tell: so many of the names that it gave to sets drawn at random from them
were there. `benchmarks/gap_random.py` counts them by clearness, and says on other sets whether that holds.
"""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

from calibration.gap.data.found_effect import FoundEffect
from calibration.gap.estimate.acceptance import NINETY_FIVE
from onboard.vehicle import EFFECTS, Vehicle


class Counted(NamedTuple):
    """Names that were this clear and no clearer.

    Attributes:
        least: clearness from which on they are, in standard errors.
        right: how many named what was hidden, or an effect that the report says it could also be.
    """

    least: float
    right: int
    total: int


COUNTED = (Counted(0.0, 17, 24), Counted(3.0, 152, 159), Counted(30.0, 172, 173))
"""From low to high; of the 442 sets of three programs of which docs/gap_figures.md says so."""

BESIDE_A_GAP = (Counted(0.0, 3, 7), Counted(30.0, 6, 6))
"""Likewise of names beside a gap that they do not explain, in the 139 sets of which that page says so: what
nobody knows makes the nearest name grow until it is beyond chance, in another channel, too."""


def clearness(effect: FoundEffect, vehicle: Vehicle) -> float:
    """Distance of the clearest parameter from what the vehicle file says, in its standard errors."""
    filed = {one.name: one.values() for one in vehicle.effects}.get(effect.name, {})
    distances = [0.0]
    for name, found in effect.parameters.items():
        rule = EFFECTS[effect.name].parameters[name]
        neutral = filed.get(name, rule.absent if rule.neutral is None else rule.neutral)
        error = 0.5 * (found.ci95[1] - found.ci95[0]) / NINETY_FIVE
        if neutral is not None and error > 0.0:
            distances.append(abs(found.value - neutral) / error)
    return max(distances)


def probability(clear: float, explained: bool) -> float:
    """That a name is right: mean of Jeffreys' posterior of its like.

    Args:
        clear: its clearness, in standard errors.
        explained: whether the names of its flights explain what these lack.
    """
    like = COUNTED if explained else BESIDE_A_GAP
    counted = max((one for one in like if one.least <= clear), key=lambda one: one.least)
    return (counted.right + 0.5) / (counted.total + 1.0)


def with_probability(effects: Sequence[FoundEffect], vehicle: Vehicle, explained: bool) -> list[FoundEffect]:
    """The effects, each with the probability that its name is right; arguments as of :func:`probability`."""
    return [
        dataclasses.replace(one, probability=round(probability(clearness(one, vehicle), explained), 3))
        for one in effects
    ]
