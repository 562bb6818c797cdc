"""Who carries out what a wizard asks: a person at a terminal, flags, or an assistant behind a socket.

A wizard never knows which. It gives a :class:`Task`, asks a :class:`Question`, shows :class:`Gauge` s, and
hears of :class:`Paused`, :class:`StepAgain` or :class:`StepBack` when the person says so.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol

from calibration.errors import CalibrationError
from onboard.errors import EndedByOperator, InputError, SafetyStop


class Paused(CalibrationError, EndedByOperator):
    """The operator stops here; everything recorded is kept, and the same command goes on later."""


class StepAgain(CalibrationError):
    """The operator wants this step once more."""


class StepBack(CalibrationError):
    """The operator wants the step before."""


class StepSkipped(CalibrationError):
    """The operator leaves this step out."""


class AnswerNotUsable(CalibrationError, InputError):
    """An answer that cannot be used: wrong unit, or far from anything plausible."""


class NotConfirmed(CalibrationError, SafetyStop):
    """A safety question that was not answered with what it asks for."""


@dataclass(frozen=True)
class Task:
    """Something to do with one's hands.

    Attributes:
        action: what it is, for an assistant ("hang", "twist").
        text: what to do, for a person: one or two sentences.
        parameters: of the action, in SI units.
        noticed: the wizard sees by itself when it is done, so that a person need not say so.
    """

    action: str
    text: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    noticed: bool = False


@dataclass(frozen=True)
class Question:
    """Something to measure, and what a sensible answer looks like.

    Attributes:
        name: for flags, files and assistants ("string_distance_top").
        text: for a person.
        unit: of the answer, SI.
        shown_unit: the unit in which people say it ("mm").
        plausible: lowest and highest value that is taken without asking again, in `unit`.
        half_width: instrument error as half the width of a rectangle, in `unit`.
        readings: how often to measure.
    """

    name: str
    text: str
    unit: str
    shown_unit: str
    plausible: tuple[float, float]
    half_width: float
    readings: int = 1


class Light(Enum):
    """How a live number stands."""

    GREEN = "green"
    AMBER = "yellow"
    RED = "red"


@dataclass(frozen=True)
class Gauge:
    """One live number: what it is, its value in words, and whether it is good."""

    name: str
    text: str
    light: Light = Light.GREEN


class Operator(Protocol):
    """What a wizard needs from whoever stands at the bench."""

    def begin(self, title: str, number: int) -> None:
        """A step begins."""

    def tell(self, text: str) -> None:
        """Something worth reading."""

    def warn(self, text: str) -> None:
        """Something is wrong; the text says what to do."""

    def do(self, task: Task) -> dict[str, Any]:
        """Return when `task` is done (at once when it will be `noticed`), with what an assistant reports.

        Raises:
            Paused, StepAgain, StepBack, StepSkipped: the person said so.
        """

    def measure(self, question: Question) -> list[float]:
        """Readings in the question's unit.

        Raises:
            AnswerNotUsable: no usable answer where nobody can be asked again.
        """

    def confirm(self, sentence: str, phrase: str) -> None:
        """A safety question: go on only when `phrase` was typed, or a flag says so.

        Raises:
            NotConfirmed: it was not.
        """

    def agree(self, question: str) -> bool:
        """A plain yes or no."""

    def live(self, title: str) -> AbstractContextManager[Callable[[Sequence[Gauge]], None]]:
        """Show live numbers: call what it gives with the present ones, as often as wished."""
