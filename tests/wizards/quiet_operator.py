"""An operator for tests: does as a script says and remembers what it was told."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from calibration.bench.procedures.operator import Gauge, NotConfirmed, Question, Task


class QuietOperator:
    """Answers from a table; `obstacles` are raised in the place of doing a task, once each."""

    def __init__(
        self, answers: dict[str, list[float]] | None = None, obstacles: dict[str, Exception] | None = None
    ) -> None:
        self.answers = answers or {}
        self.obstacles = obstacles or {}
        self.begun: list[str] = []
        self.done: list[str] = []
        self.told: list[str] = []

    def begin(self, title: str, number: int) -> None:
        self.begun.append(title)

    def tell(self, text: str) -> None:
        self.told.append(text)

    def warn(self, text: str) -> None:
        self.told.append(text)

    def do(self, task: Task) -> dict[str, Any]:
        obstacle = self.obstacles.pop(task.action, None)
        if obstacle is not None:
            raise obstacle
        self.done.append(task.action)
        return {}

    def measure(self, question: Question) -> list[float]:
        return self.answers[question.name]

    def confirm(self, sentence: str, phrase: str) -> None:
        raise NotConfirmed(sentence)

    def agree(self, question: str) -> bool:
        return True

    @contextmanager
    def live(self, title: str) -> Iterator[Callable[[Sequence[Gauge]], None]]:
        yield lambda gauges: None
