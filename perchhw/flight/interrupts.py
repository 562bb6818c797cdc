"""Ctrl-C, SIGTERM and a terminal that closes: the first asks for a landing, the second cuts the motors.

So do Ctrl-Z and Ctrl-\\: what they do by default, to suspend or to kill, would let the drone fall.

Who watches the flight from another process (the keys of its screen) asks for either by a signal of its own,
however often.

Whatever the program does: Python runs a signal's handler in the main thread, between two of its instructions;
one that is stuck in a call or holds a lock would keep it waiting. So the handler does nothing. The
interpreter itself writes the signal's number to a socket, without a lock, and a thread that has nothing else
to do reads it.
"""

import signal
import socket
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any, Self

from perchhw.operator_signals import CUT, LAND, known

_OF_TERMINAL = known("SIGHUP", "SIGQUIT", "SIGTSTP")
_HEARD = {signal.SIGINT, signal.SIGTERM, *_OF_TERMINAL, *(n for n in (LAND, CUT) if n is not None)}
_AT_MOST_A_LANDING = {LAND, *known("SIGHUP")}
"""A terminal closes once, but its shell and the system each say so."""


def _noted(_number: int, _frame: FrameType | None) -> None:
    """The thread hears of it; what matters here is that the signal does not do what it does by default."""


def _outlives_terminal(number: signal.Signals) -> bool:
    """Whether the program was started to ignore this of its terminal, as with ``nohup``."""
    return number in _OF_TERMINAL and signal.getsignal(number) is signal.SIG_IGN


class OperatorInterrupts:
    """While open, counts the signals; the second one triggers the stop at once.

    Signals can only be caught in the main thread; elsewhere (an attempt flown by a test or a service thread)
    nothing is installed and the caller's own handling stays.

    Attributes:
        count: signals so far, as if all were Ctrl-C. The supervisor's loop looks at it; nobody is called and
            no queue is filled.
    """

    def __init__(self) -> None:
        self.count = 0
        self._stop: Callable[[], None] | None = None
        self._previous: dict[signal.Signals, Any] = {}
        self._previous_wakeup = -1
        self._read_end, self._write_end = socket.socketpair()
        self._write_end.setblocking(False)
        self._thread = threading.Thread(target=self._listen, name="OperatorInterrupts", daemon=True)

    def stop_by(self, trigger: Callable[[], None]) -> None:
        """From now on the second signal calls `trigger`, which must return at once."""
        self._stop = trigger

    def _note(self, number: int) -> None:
        if number in _AT_MOST_A_LANDING:
            self.count = max(self.count, 1)
            return
        self.count = max(self.count + 1, 2 if number == CUT else 1)
        if self.count > 1 and self._stop is not None:
            self._stop()

    def _listen(self) -> None:
        while numbers := self._read_end.recv(64):
            for number in numbers:
                if number in _HEARD:
                    self._note(number)

    def __enter__(self) -> Self:
        self._thread.start()
        if threading.current_thread() is threading.main_thread():
            self._previous_wakeup = signal.set_wakeup_fd(self._write_end.fileno(), warn_on_full_buffer=False)
            self._previous = {
                number: signal.signal(number, _noted) for number in _HEARD if not _outlives_terminal(number)
            }
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        if self._previous:
            signal.set_wakeup_fd(self._previous_wakeup)
        self._write_end.close()
        self._thread.join()
        self._read_end.close()
