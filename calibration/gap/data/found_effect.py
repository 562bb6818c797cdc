"""An effect that was found, in the air, in the sensors or at landings, as the report has it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Self

import numpy as np

from calibration.measurement import Interval, interval_of
from onboard.arrays import FloatArray, IntArray
from onboard.vehicle import EFFECTS


class Verdict(StrEnum):
    """What flights, or landings by their motion or their outcomes, say of a vehicle file."""

    EFFECTS_FOUND = "effects_found"
    NO_GAP = "no_gap"
    UNEXPLAINED_GAP = "unexplained_gap"
    """something structured is left that no known effect explains, whether or not others were found"""
    CANNOT_TELL = "cannot_tell"
    """too few landings, or landings that would look alike with legs far from the filed ones"""


@dataclass(frozen=True, kw_only=True)
class FoundParameter:
    """A number of an effect.

    Attributes:
        at_bound: the fit ended at the limit of what is physical: a warning.
        unseen: its interval holds all that is physical: the flights say nothing of it.
    """

    value: float
    unit: str
    ci95: Interval
    at_bound: bool = False
    unseen: bool = False

    def json_shape(self) -> dict[str, Any]:
        """As in the contract; `at_bound` and `unseen` where it is so."""
        shown: dict[str, Any] = {"value": self.value, "unit": self.unit, "ci95": self.ci95}
        marks = {"at_bound": self.at_bound, "unseen": self.unseen}
        return shown | {mark: True for mark, is_so in marks.items() if is_so}


@dataclass(frozen=True)
class Improvement:
    """What an effect does for flights that no fit saw: attributes as of :class:`FoundEffect`."""

    error_before: float
    error_after: float
    improvement_ci95: Interval
    metric: str

    @classmethod
    def over(cls, drawn: IntArray, errors: Callable[[IntArray], FloatArray], metric: str) -> Self:
        """From errors (..., 2) before and after, over flights (..., n): of all, and of the sets `drawn`."""
        before, after = errors(np.arange(drawn.shape[-1])).tolist()
        again = errors(drawn)
        return cls(before, after, interval_of(again[:, 0] - again[:, 1]), metric)


@dataclass(frozen=True, kw_only=True)
class FoundEffect:
    """One effect that was missing.

    Attributes:
        name: as in :data:`onboard.vehicle.effects.EFFECTS`.
        parameters: by name.
        error_before, error_after: without and with it, on flights that no fit saw, in the metric that it
            improves most; with the effects before it in the model.
        improvement_ci95: of `error_before` minus `error_after`.
        ambiguous_with: effects that these flights cannot tell from it.
        separated_by: what a flight must do to tell them apart, in words.
        metric: what the errors are, with the unit.
        probability: that the name, or one of `ambiguous_with`, is right; None where nothing tells (landings).
    """

    name: str
    parameters: Mapping[str, FoundParameter]
    error_before: float
    error_after: float
    improvement_ci95: Interval
    ambiguous_with: tuple[str, ...] = ()
    separated_by: str = ""
    metric: str = ""
    probability: float | None = None


def separations(names: Sequence[str]) -> str:
    """What a flight must do to tell effects apart, in words."""
    return "; ".join(f"{name}: {EFFECTS[name].revealed_by}" for name in names)
