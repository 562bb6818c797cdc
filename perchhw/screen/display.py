"""What a command that flies tells its operator, and asks: the side of the command."""

import logging
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from onboard.record.recorder import Scalar
from perchhw.screen.watch import FlightWatch
from perchhw.supervisor import FlightState, Observation


@dataclass(frozen=True, kw_only=True)
class Progress:
    """Where several attempts stand.

    Attributes:
        attempts: how many there are.
        outcomes: outcome and count of those that are done.
        time_left_s: what is left will take, s, or None.
        packs_left: batteries that it will take, or None.
    """

    attempts: int
    outcomes: tuple[tuple[str, int], ...] = ()
    time_left_s: float | None = None
    packs_left: int | None = None


class Display(ABC):
    """Shows flights, one after another. What a flight calls returns at once, whatever the terminal does."""

    def __init__(self) -> None:
        self._watch = FlightWatch()

    def phase(self, state: FlightState) -> None:
        """An ``on_phase`` of a flight."""
        self._watch.phase(state)

    def look(self, state: FlightState, observation: Observation) -> None:
        """An ``on_look`` of a flight."""
        self._watch.look(state, observation)

    def write(self, topic: str, t: float, values: Mapping[str, Scalar]) -> None:
        """A listener of a flight's record."""
        self._watch.write(topic, t, values)

    def event(self, name: str, t: float, fields: Mapping[str, Any]) -> None:
        """A listener of a flight's record."""
        self._watch.event(name, t, fields)

    def shows(self, folder: Path, condition: str) -> dict[str, Any]:
        """Begin, and give what a flight's function takes to be shown here."""
        self.begin(folder, condition)
        return {"on_phase": self.phase, "on_look": self.look, "listener": self}

    @abstractmethod
    def begin(self, folder: Path, condition: str, attempt: int | None = None) -> None:
        """A flight begins, with its record in `folder`; number `attempt` from 1, where there are several."""

    @abstractmethod
    def stage(self, name: str, waits_for: str, planned: tuple[str, ...]) -> None:
        """What a command does now that flies nothing, what it waits for, and all that it does, in order."""

    @abstractmethod
    def between(self) -> None:
        """Another flight is to follow: words of notes are asked for now, and a pause is made that was wanted.
        After the last flight they are asked for when the display is closed, however it ended."""

    @abstractmethod
    def say(self, text: str) -> None:
        """Tell something that needs no answer."""

    @abstractmethod
    def viewed(self, text: str) -> None:
        """Tell where the flight is seen, from any thread; it stays to be read."""

    @abstractmethod
    def progress(self, progress: Progress) -> None:
        """Several attempts have come so far."""

    @abstractmethod
    def confirm(self, request: str) -> None:
        """Have the operator do something; returns when it is done.

        Raises:
            NobodyToAsk: nobody answers any more.
        """

    @abstractmethod
    def log(self, text: str) -> None:
        """Take what the program's log says, from any thread."""


class _LogToDisplay(logging.Handler):
    """A log that blocks nobody: not by a terminal that takes nothing."""

    def __init__(self, display: Display) -> None:
        super().__init__()
        self._display = display

    def emit(self, record: logging.LogRecord) -> None:
        self._display.log(self.format(record))


@contextmanager
def log_to(display: Display) -> Iterator[None]:
    """What would be logged on the terminal goes to the display instead."""
    root = logging.getLogger()
    for_terminal = [
        handler
        for handler in root.handlers
        if isinstance(handler, logging.StreamHandler) and handler.stream is sys.stderr
    ]
    ours = _LogToDisplay(display)
    for handler in for_terminal:
        ours.setFormatter(handler.formatter)
        root.removeHandler(handler)
    if for_terminal:
        root.addHandler(ours)
    try:
        yield
    finally:
        root.removeHandler(ours)
        for handler in for_terminal:
            root.addHandler(handler)
