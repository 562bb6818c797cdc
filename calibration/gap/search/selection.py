"""What a search has to go by, and one effect that came into the model; what is told while it goes on."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from calibration.gap.estimate.acceptance import Judgement
from calibration.gap.estimate.refine import Fitted, Training

Progress = Callable[[str], None]
"""Called with what is being looked at."""


@dataclass(frozen=True)
class SearchContext:
    """What all parts of a search have in common.

    Attributes:
        training: flights to fit to.
        rng: of the bootstrap.
        progress: told what is being looked at.
        barred: effects that are not believed whatever they gain, and take no name's place, each with the
            reason; what they explain better gets no other name either.
    """

    training: Training
    rng: np.random.Generator
    progress: Progress = lambda _: None
    barred: Mapping[str, str] = field(default_factory=dict)


class TimeToGo:
    """How long things of one kind have taken, and with it the time to go.

    Args:
        clock: that tells the time in s.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._began = clock, clock()
        self._done = 0

    def to_go(self, left: int = 1) -> str:
        """In words, at the mean pace of the things done; empty before the first is.

        Args:
            left: things still to do, the next included.
        """
        done, self._done = self._done, self._done + 1
        if not done:
            return ""
        return f" (about {left * (self._clock() - self._began) / done:.0f} s to go)"


@dataclass(frozen=True)
class SelectionStep:
    """One effect that came into the model.

    Attributes:
        effect: its name.
        judgement: why.
        after: the fit with it.
        rivals: effects that explained nearly as much, with the gain that each lacked.
    """

    effect: str
    judgement: Judgement
    after: Fitted
    rivals: dict[str, float] = field(default_factory=dict)
