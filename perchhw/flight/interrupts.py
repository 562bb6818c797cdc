"""Ctrl-C and SIGTERM as events: the flight ends in order, and sockets and record close behind it."""

import queue
import signal
import threading
from types import FrameType, TracebackType
from typing import Any, Self

from perchhw.supervisor import Event, OperatorAbort

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class OperatorInterrupts:
    """While open, the first signal asks the supervisor to land, the second to cut the motors.

    Signals can only be caught in the main thread; elsewhere (an attempt flown by a test or a service thread)
    nothing is installed and the caller's own handling stays.
    """

    def __init__(self, events: "queue.Queue[Event]") -> None:
        self._events = events
        self._previous: dict[signal.Signals, Any] = {}
        self.count = 0

    def _handle(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1
        self._events.put(OperatorAbort(urgent=self.count > 1))

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._previous = {number: signal.signal(number, self._handle) for number in _SIGNALS}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)
