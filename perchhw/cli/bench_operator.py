"""The person at the terminal, as the wizards see them: prompts, keys, live numbers; all on stderr."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from calibration.bench.procedures.operator import (
    AnswerNotUsable,
    Gauge,
    NotConfirmed,
    Paused,
    Question,
    StepAgain,
    StepBack,
    StepSkipped,
    Task,
)
from calibration.bench.procedures.readings import parse_reading
from onboard.quantity import UnitError
from perchhw.consoles import in_width, progress_console
from perchhw.errors import NobodyToAsk

if TYPE_CHECKING:
    from rich.table import Table

_KEYS_BEFORE = "[Enter] done  [q] pause"
_KEYS = "[Enter] done  [r] step again  [s] skip  [b] step back  [q] pause"
_OF_STEPS = {"r": StepAgain, "s": StepSkipped, "b": StepBack}


class TerminalOperator:
    """A person who reads, does and types.

    Args:
        yes: go on without being told that a task is done (``--yes``).
        confirmed: phrases of safety questions given as flags.
    """

    def __init__(self, yes: bool = False, confirmed: Sequence[str] = ()) -> None:
        self._screen = progress_console()
        self._yes = yes
        self._confirmed = tuple(confirmed)
        self._in_steps = False

    def begin(self, title: str, number: int) -> None:
        """Head of a step; from the first on its keys are heard."""
        self._in_steps = True
        self._screen.print(f"\n{number:2d}  {title}", style="bold", markup=False)

    def tell(self, text: str) -> None:
        """Plain text."""
        self._screen.print(in_width(text, self._screen, "    "), markup=False, soft_wrap=True)

    def warn(self, text: str) -> None:
        """Text that stands out."""
        told = in_width(text, self._screen, "  ! ")
        self._screen.print(told, style="yellow", markup=False, soft_wrap=True)

    def do(self, task: Task) -> dict[str, Any]:
        """Say what to do; wait for Enter or a key unless the wizard notices by itself.

        Raises:
            Paused, StepAgain, StepBack, StepSkipped: the key of the person; Ctrl-D pauses, too.
            NobodyToAsk: there is no terminal and no ``--yes``.
        """
        self.tell(task.text)
        if task.noticed or self._yes:
            return {}
        while typed := self._ask(_KEYS if self._in_steps else _KEYS_BEFORE):
            self._key(typed)
            self.warn(f"{typed!r} is none of these keys; Enter alone says that it is done")
        return {}

    def measure(self, question: Question) -> list[float]:
        """Ask until the readings can be used.

        Raises:
            Paused, StepAgain, StepBack, StepSkipped: the key of the person.
            NobodyToAsk: there is no terminal.
        """
        many = f", {question.readings} readings separated by commas" if question.readings > 1 else ""
        prompt = f"{question.text} ({question.shown_unit}{many})"
        while True:
            typed = self._ask(prompt)
            self._key(typed)
            try:
                return [self._reading(part, question) for part in _parts(typed, question)]
            except (AnswerNotUsable, UnitError) as error:
                self.warn(str(error))

    def _reading(self, text: str, question: Question) -> float:
        """A bare number has the unit that the prompt names."""
        bare = text.strip()
        unit = f" {question.shown_unit}" if bare.replace(".", "", 1).isdigit() else ""
        return parse_reading(bare + unit, question)

    def confirm(self, sentence: str, phrase: str) -> None:
        """Have a phrase typed in full.

        Raises:
            NotConfirmed: something else was typed, or nobody can type and no flag said it.
        """
        if phrase in self._confirmed:
            self.tell(f"{sentence} Confirmed by flag.")
            return
        if not sys.stdin.isatty():
            raise NotConfirmed(f"{sentence} Say so with --confirm {phrase!r}")
        if self._ask(f"{sentence} Type {phrase!r}") != phrase:
            raise NotConfirmed(f"{sentence} That was not confirmed, so nothing was started")

    def agree(self, question: str) -> bool:
        """Yes or no; ``--yes`` agrees."""
        if self._yes:
            self.tell(f"{question} yes")
            return True
        return self._ask(f"{question} [y/N]").lower() in ("y", "yes")

    @contextmanager
    def live(self, title: str) -> Iterator[Callable[[Sequence[Gauge]], None]]:
        """A table that is redrawn; on anything but a terminal only its last state is printed."""
        from rich.live import Live

        with Live(console=self._screen, refresh_per_second=8, transient=True) as view:
            last: list[Gauge] = []

            def show(gauges: Sequence[Gauge]) -> None:
                last[:] = gauges
                if self._screen.is_terminal:
                    view.update(_gauge_table(title, gauges))

            yield show
        if last:
            self.tell(f"{title}: " + ", ".join(f"{gauge.name} {gauge.text}" for gauge in last))

    def _key(self, typed: str) -> None:
        key = typed.strip().lower()
        if key == "q":
            raise Paused("paused")
        if self._in_steps and key in _OF_STEPS:
            raise _OF_STEPS[key]

    def _ask(self, prompt: str) -> str:
        if not sys.stdin.isatty():
            raise NobodyToAsk(
                f"this would ask: {prompt}; but there is no terminal: answer with --input FILE.toml, --yes, "
                "or an assistant (--hands)"
            )
        try:
            return self._screen.input(f"    {prompt}: ", markup=False).strip()
        except EOFError as error:  # Ctrl-D, or the terminal is gone
            self._screen.print()  # what follows does not begin behind the prompt
            raise Paused("paused: the input has ended") from error
        except KeyboardInterrupt:
            self._screen.print()
            raise


def _parts(typed: str, question: Question) -> list[str]:
    """As many readings as were asked for: ``12,5`` is neither two of them nor one.

    Raises:
        AnswerNotUsable: it is another number of them.
    """
    parts = typed.split(",")
    if len(parts) != question.readings:
        wanted = "one reading is" if question.readings == 1 else f"{question.readings} readings are"
        raise AnswerNotUsable(
            f"{question.name}: {wanted} asked for, and {typed!r} is {len(parts)}: a comma stands between "
            "readings, decimals follow a point"
        )
    return parts


def _gauge_table(title: str, gauges: Sequence[Gauge]) -> "Table":
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title, title_justify="left", show_header=False, box=None, padding=(0, 2))
    for gauge in gauges:
        table.add_row(Text(gauge.name), Text(gauge.text, style=gauge.light.value))
    return table
