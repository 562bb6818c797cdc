"""The screen as the flight's process sees it: a child that draws, a thread that feeds it and hears its keys.

Nothing here can hold up a flight, which leaves its readings and goes on (:mod:`perchhw.screen.watch`); the
thread sends only what the child takes. When the child ends early, lines take its place.
"""

import contextlib
import json
import logging
import math
import os
import queue
import select
import signal
import socket
import subprocess
import sys
import threading
from collections import deque
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, Self

from onboard.clock import monotonic
from perchhw.errors import NobodyToAsk
from perchhw.flight.caught import Caught
from perchhw.operator_signals import CUT, LAND
from perchhw.record.notes import add_note
from perchhw.screen.display import Display, Progress, log_to
from perchhw.screen.keys import NOBODY
from perchhw.screen.lines import Lines
from perchhw.screen.snapshot import Snapshot
from perchhw.screen.terminal import LEAVE, restore, settings_of
from perchhw.screen.watch import FlightWatch
from perchhw.supervisor import FlightState

_log = logging.getLogger(__name__)
PERIOD_S = 0.2
"""Between two snapshots, s."""
_ENDS_WITHIN_S = 1.0
"""How long a child may take to end whose terminal takes nothing, s."""
_WORDS_WITHIN_S = 120.0
"""For so long a command that was told to end waits for the words of its notes, s."""
_FOR_THE_FLIGHT = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP}


@dataclass(frozen=True)
class _Mark:
    """A moment to be noted: record, time on its clock (s), phase."""

    folder: Path
    t: float
    phase: str


def _nothing(_number: int, _frame: FrameType | None) -> None:
    """What a signal does that comes too late."""


class Screen(Display):
    """The screen, while open. Opened by the main thread.

    Args:
        title: the command.
        drone: URI.
    """

    def __init__(self, title: str, drone: str) -> None:
        super().__init__()
        self._fixed = Snapshot(title=title, drone=drone)
        self._watching = False
        self._view = ""
        self._folder: Path | None = None
        self._paused = False
        self._marks: list[_Mark] = []
        self._messages: deque[str] = deque(maxlen=3)
        self._logged: list[str] = []
        self._answers: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._closing = False
        self._cut = False
        self._instead: Lines | None = None
        self._stack = ExitStack()
        self._unsent = b""

    # Opening and closing

    def __enter__(self) -> Self:
        self._keyboard = sys.stdin.fileno()
        self._settings = settings_of(self._keyboard)
        self._connection, theirs = socket.socketpair()
        with theirs:
            self._child = _started(self._keyboard, theirs.fileno())
        self._connection.setblocking(False)
        self._thread = threading.Thread(target=self._run, name="screen", daemon=True)
        self._thread.start()
        self._stack.enter_context(log_to(self))
        self._handlers = {
            number: signal.signal(number, handler)
            for number, handler in (
                (signal.SIGTERM, signal.default_int_handler),
                (signal.SIGHUP, signal.default_int_handler),
                (CUT, self._cut_between_flights),
                (LAND, _nothing),
            )
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN
        }
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if CUT in self._handlers:  # a key that is still held; nothing flies any more
            signal.signal(CUT, _nothing)
        self._cut = False
        try:
            # Who ends it once more, or has left, leaves the notes without words.
            with contextlib.suppress(KeyboardInterrupt, NobodyToAsk):
                self._ask_for_words(math.inf if error is None else monotonic() + _WORDS_WITHIN_S)
        finally:
            self._close(kind, error, trace)

    def _close(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        before = signal.signal(
            signal.SIGINT, _nothing
        )  # whoever ends it now would leave the terminal as it is
        for number in self._handlers:
            signal.signal(number, _nothing)
        self._closing = True
        with contextlib.suppress(OSError):  # the child has gone first
            self._connection.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._connection.close()
        if self._instead is None:
            self._leave()
        else:
            self._instead.__exit__(kind, error, trace)
        self._stack.close()
        for text in self._logged:
            sys.stderr.write(f"{text}\n")
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        signal.signal(signal.SIGINT, before)

    def _cut_between_flights(self, _number: int, _frame: FrameType | None) -> None:
        """A key that is held must not end the program anywhere, only where it waits for the operator;
        one that flies nothing ends at once, as with Ctrl-C.
        """
        if self._fixed.on_desk:
            raise KeyboardInterrupt
        self._cut = True

    def _leave(self) -> str:
        """End the child, put the terminal back; what the child said last."""
        try:
            said = self._child.communicate(timeout=_ENDS_WITHIN_S)[1]
        except subprocess.TimeoutExpired:
            self._child.kill()
            said = self._child.communicate()[1]
        restore(self._keyboard, self._settings)
        if self._child.returncode != 0:
            os.write(sys.stderr.fileno(), LEAVE)
        return said.decode(errors="replace").strip().rpartition("\n")[2]

    # Of a flight

    def phase(self, state: FlightState) -> None:
        """An ``on_phase`` of a flight."""
        super().phase(state)
        if self._instead is not None:
            self._instead.phase(state)

    # Of the command

    def begin(self, folder: Path, condition: str, attempt: int | None = None) -> None:
        """A flight begins."""
        self._watch, self._folder = FlightWatch(), folder
        self._fixed = self._fixed.with_changes(condition=condition, attempt=attempt)
        self._watching = True
        if self._instead is not None:
            self._instead.begin(folder, condition, attempt)

    def stage(self, name: str, waits_for: str, planned: tuple[str, ...]) -> None:
        """In the place of a flight's phases; the key that stops ends the command."""
        phases = (*self._fixed.phases, name)
        self._fixed = self._fixed.with_changes(
            on_desk=True, phases=phases, planned=planned, waiting_for=waits_for
        )
        if self._instead is not None:
            self._instead.stage(name, waits_for, planned)

    def between(self) -> None:
        """Ask for what was marked, then wait if the operator wants a pause.

        Raises:
            KeyboardInterrupt: a key has asked for a stop since the last flight.
        """
        if self._cut:
            raise KeyboardInterrupt
        self._ask_for_words()
        if self._paused:
            self._ask("Paused: make ready for the next one")
            self._paused = False

    def say(self, text: str) -> None:
        """Shown among the messages."""
        if text not in self._messages:  # as said before each attempt
            self._messages.append(text)
        if self._instead is not None:
            self._instead.say(text)

    def viewed(self, text: str) -> None:
        """A row of its own, and again when the screen is closed."""
        self._view = text
        self._logged.append(text)
        if self._instead is not None:
            self._instead.viewed(text)

    def progress(self, progress: Progress) -> None:
        """Shown above the messages."""
        self._fixed = self._fixed.with_changes(**vars(progress))
        if self._instead is not None:
            self._instead.progress(progress)

    def confirm(self, request: str) -> None:
        """Asked in the place for questions."""
        self._ask(request)

    def log(self, text: str) -> None:
        """Its first line now, all of it when the screen is closed."""
        if self._instead is not None:
            self._instead.log(text)
            return
        self._logged.append(text)
        self._messages.append(text.partition("\n")[0])

    def _ask(self, question: str, words: bool = False, until: float = math.inf) -> str:
        self._watching = False
        number = self._fixed.question_number + 1
        self._show_question(question, number, words)
        try:
            while self._instead is None and monotonic() < until:
                if self._cut:
                    raise KeyboardInterrupt
                try:
                    answer = self._answers.get(timeout=PERIOD_S)
                except queue.Empty:
                    continue
                if answer.get("key") == NOBODY:
                    raise NobodyToAsk("nobody answers any more: the drone was left as it is")
                if answer.get("key") == "n" and not words:
                    self._note_now()
                    number = self._fixed.question_number + 1
                    self._show_question(question, number, words)
                elif answer.get("number") == number:
                    return str(answer["answer"])
        finally:
            self._show_question(None, self._fixed.question_number, False)
        if self._instead is not None and not words:
            self._instead.confirm(question)
        return ""

    def _show_question(self, question: str | None, number: int, words: bool) -> None:
        self._fixed = self._fixed.with_changes(
            question=question, question_number=number, wants_words=words and question is not None
        )

    # Notes

    def _ask_for_words(self, until: float = math.inf) -> None:
        """For each moment that was marked in a flight, `until` then on the monotonic clock (s)."""
        while self._marks and self._instead is None:
            mark = self._marks.pop(0)
            self._note(mark, self._ask(f"Note on {mark.phase}:", words=True, until=until))

    def _mark(self) -> _Mark | None:
        state, folder = self._watch.state, self._folder
        return None if state is None or folder is None else _Mark(folder, state.time, state.phase.value)

    def _note_now(self) -> None:
        mark = self._mark()
        if mark is not None:
            self._note(mark, self._ask("Note on the last attempt:", words=True))

    def _note(self, mark: _Mark, text: str) -> None:
        try:
            add_note(mark.folder, mark.t, text.strip(), mark.phase)
        except OSError as error:
            self.say(f"the note was not kept: {error}")

    # The thread

    def _run(self) -> None:
        with Caught(lambda error: _log.error("the screen's thread failed", exc_info=error)):
            self._feed()
        if not self._closing:
            self._take_its_place()

    def _feed(self) -> None:
        unread = b""
        while not self._closing:
            ready, _, _ = select.select([self._connection], [], [], PERIOD_S)
            if ready:
                read = self._received()
                if not read:
                    return
                *whole, unread = (unread + read).split(b"\n")
                for line in whole:
                    self._heard(json.loads(line))
            if not self._sent():
                return

    def _received(self) -> bytes:
        try:
            return self._connection.recv(1 << 16)
        except ConnectionError:
            return b""

    def _sent(self) -> bool:
        """Send the newest snapshot, as far as it is taken; False when nobody is there."""
        if not self._unsent:
            self._unsent = self._snapshot().to_line()
        try:
            self._unsent = self._unsent[self._connection.send(self._unsent) :]
        except BlockingIOError:
            return True  # a terminal that takes nothing
        except OSError:
            return False
        return True

    def _snapshot(self) -> Snapshot:
        readings = self._watch.readings()
        readings["flying"] = self._watching and readings["flying"]
        marks, messages = len(self._marks), tuple(self._messages)
        return self._fixed.with_changes(
            view=self._view, paused=self._paused, marks=marks, messages=messages, **readings
        )

    def _heard(self, message: dict[str, Any]) -> None:
        match message.get("key"):
            case "p" if self._fixed.attempts:  # a single flight is the last
                self._paused = not self._paused
            case "n" if self._watching:
                mark = self._mark()
                if mark is not None:
                    self._note(mark, "")
                    self._marks.append(mark)
            case _:
                self._answers.put(message)

    def _take_its_place(self) -> None:
        """Lines from now on."""
        said = self._leave()
        lines = Lines().__enter__()
        lines.log(f"the screen has ended ({said or 'it said nothing'}); the flight goes on: Ctrl-C lands it")
        self._instead = lines


def _started(terminal: int, connection: int) -> "subprocess.Popen[bytes]":
    """The child. What is meant for the flight must not end it, not even before it can say so."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _FOR_THE_FLIGHT)
    try:
        return subprocess.Popen(
            [sys.executable, "-m", "perchhw.screen", str(connection), str(os.getpid())],
            stdin=terminal,
            stdout=sys.stderr.fileno(),
            stderr=subprocess.PIPE,
            pass_fds=(connection,),
        )
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
