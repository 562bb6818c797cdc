"""Without a terminal: a line on stderr per change, by a thread that may wait where the flight may not."""

import queue
import threading
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from perchhw.consoles import progress_console
from perchhw.errors import NobodyToAsk
from perchhw.screen.display import Display, Progress, log_to
from perchhw.supervisor import FlightState

_FLUSHED_WITHIN_S = 2.0
"""How long a command waits for a stderr that takes nothing, s."""


class _Line(NamedTuple):
    text: str
    loud: bool = False


class Lines(Display):
    """Says each phase and each alert once, as long as it is the same; alerts with a bell and in red."""

    def __init__(self) -> None:
        super().__init__()
        self._lines: queue.SimpleQueue[_Line | threading.Event | None] = queue.SimpleQueue()
        self._said: tuple[str | None, str | None] = (None, None)
        self._progress = ""
        self._attempts: int | None = None
        self._stack = ExitStack()
        self._thread = threading.Thread(target=self._write_lines, name="lines", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        self._stack.enter_context(log_to(self))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()
        self._lines.put(None)
        self._thread.join(_FLUSHED_WITHIN_S)

    def phase(self, state: FlightState) -> None:
        """Say what is new."""
        super().phase(state)
        phase, alert = self._said
        self._said = (state.phase.value, state.alert)
        if state.alert is not None and state.alert != alert:
            self._lines.put(_Line(state.alert, loud=True))
        if state.phase.value != phase:
            self._lines.put(_Line(f"  {state.phase.value}"))

    def begin(self, folder: Path, condition: str, attempt: int | None = None) -> None:
        """Say which attempt begins."""
        self._said = (None, None)
        if attempt is not None:
            of = "" if self._attempts is None else f" of {self._attempts}"
            self._lines.put(_Line(f"attempt {attempt}{of}: {condition}"))

    def stage(self, name: str, waits_for: str, planned: tuple[str, ...]) -> None:
        """A line."""
        self._lines.put(_Line(f"  {name}: waits for {waits_for}"))

    def between(self) -> None:
        """Nothing is asked here."""

    def say(self, text: str) -> None:
        """A line."""
        self._lines.put(_Line(text))

    def viewed(self, text: str) -> None:
        """A line."""
        self.say(text)

    def progress(self, progress: Progress) -> None:
        """A line, when it differs from the last."""
        self._attempts = progress.attempts
        done = sum(count for _, count in progress.outcomes)
        words = ", ".join(f"{name} {count}" for name, count in progress.outcomes)
        line = f"{done} of {progress.attempts} done" + (f": {words}" if words else "")
        if line != self._progress:
            self._progress = line
            self._lines.put(_Line(line))

    def confirm(self, request: str) -> None:
        """Ask, where the terminal can answer but shows no screen."""
        self.flush()
        try:
            progress_console().input(f"{request}, then press Enter. ", markup=False)
        except (EOFError, OSError) as error:  # Ctrl-D, or the terminal has gone
            raise NobodyToAsk("nobody answers any more: the drone was left as it is") from error

    def log(self, text: str) -> None:
        """As it is."""
        self._lines.put(_Line(text))

    def flush(self) -> None:
        """Wait until all is written, or cannot be."""
        written = threading.Event()
        self._lines.put(written)
        written.wait(_FLUSHED_WITHIN_S)

    def _write_lines(self) -> None:
        console = progress_console()
        while (line := self._lines.get()) is not None:
            if isinstance(line, threading.Event):
                line.set()
                continue
            if line.loud:
                console.bell()
            style = "bold white on red" if line.loud else None
            console.print(line.text, style=style, markup=False, soft_wrap=True)
