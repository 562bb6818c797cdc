"""Answers that were given in advance, by flags or a file, in front of another operator."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from calibration.bench.procedures.operator import AnswerNotUsable, Gauge, Operator, Question, Task
from calibration.bench.procedures.readings import parse_reading
from onboard.toml_file import read_toml


class PreparedAnswers:
    """An operator that answers what it was told and passes everything else on.

    Args:
        answers: readings by the name of the question, as text (``{"mass": ["38.1 g"]}``).
        behind: who is asked and told everything else.
    """

    def __init__(self, answers: Mapping[str, Sequence[str]], behind: Operator) -> None:
        self._answers = answers
        self._behind = behind

    def begin(self, title: str, number: int) -> None:
        """Pass on."""
        self._behind.begin(title, number)

    def tell(self, text: str) -> None:
        """Pass on."""
        self._behind.tell(text)

    def warn(self, text: str) -> None:
        """Pass on."""
        self._behind.warn(text)

    def do(self, task: Task) -> dict[str, Any]:
        """Pass on."""
        return self._behind.do(task)

    def measure(self, question: Question) -> list[float]:
        """The given readings, or what whoever stands behind measures.

        Raises:
            AnswerNotUsable: a given reading cannot be used.
        """
        given = self._answers.get(question.name)
        if given is None:
            return self._behind.measure(question)
        return [parse_reading(text, question) for text in given]

    def confirm(self, sentence: str, phrase: str) -> None:
        """Pass on."""
        self._behind.confirm(sentence, phrase)

    def agree(self, question: str) -> bool:
        """Pass on."""
        return self._behind.agree(question)

    def live(self, title: str) -> AbstractContextManager[Callable[[Sequence[Gauge]], None]]:
        """Pass on."""
        return self._behind.live(title)


def read_answers(path: Path) -> dict[str, list[str]]:
    """Answers from a TOML file: ``mass = "38.1 g"``, ``string_length = ["600 mm", "601 mm"]``.

    Raises:
        AnswerNotUsable: not TOML, or an answer that is not text.
    """
    answers: dict[str, list[str]] = {}
    for name, raw in read_toml(path, AnswerNotUsable).items():
        readings: list[Any] = raw if isinstance(raw, list) else [raw]
        if not readings or not all(isinstance(one, str) for one in readings):
            raise AnswerNotUsable(
                f'{path}: {name}: write a text with its unit, as "60.1 mm", or a list of them'
            )
        answers[name] = readings
    return answers
