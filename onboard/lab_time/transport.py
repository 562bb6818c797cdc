"""The local end of a socket whose packets belong to turns of a lab's time."""

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self

from onboard.lab_time.waiting import Workers

_GATE_S = 0.005
"""Real time for which a reader waits for its turn before it looks at its socket all the same, which may have
been closed."""


class LabTransport:
    """A socket's end; see :class:`onboard.timebase.Transport`.

    A packet belongs to a turn: who reads waits first for one that brings packets, and looks at the socket
    then. A packet that was found before its turn waits until the lab has said what time it is, so that its
    time of receipt is the lab's.

    Attributes:
        changed: notified when packets are expected, and when nobody need wait for them any more.
        count_sent: packets that were sent.
    """

    def __init__(self, workers: Workers, before: int, forget: Callable[[int], None]) -> None:
        self._workers = workers
        self._forget = forget
        self._received = self._expected = before
        self._counted = self._closed = False
        self.changed = threading.Condition(workers.lock)
        self.count_sent = 0

    @property
    def caught_up(self) -> bool:
        """Whether every packet that the lab has sent was received."""
        return self._received >= self._expected

    def expect(self, packets: int) -> None:
        """So many were sent in all; the caller holds the lock."""
        if packets != self._expected:
            self._expected = packets
            self.changed.notify_all()

    @property
    def _waits(self) -> bool:
        return self._workers.takes_turns and self.caught_up and not self._closed

    def blocking(self) -> Self:
        """The calling thread is not at work inside; it comes out with a packet of this turn."""
        return self

    def __enter__(self) -> None:
        workers = self._workers
        self._counted = workers.counted
        with workers.lock:
            if self._counted:
                workers.end()
            if self._waits:
                self.changed.wait(_GATE_S)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        workers = self._workers
        with workers.lock:
            while kind is None and self._waits:
                self.changed.wait()
            if self._counted:
                workers.begin()

    def received(self, packets: int) -> None:
        """Note packets that were received."""
        with self._workers.lock:
            self._received += packets
            self._workers.look()

    def sent(self, packets: int) -> None:
        """Note packets that were sent."""
        with self._workers.lock:
            self.count_sent += packets

    def close(self) -> None:
        """Nothing is expected here any more; the lab still waits for what was sent."""
        with self._workers.lock:
            if self._closed:
                return
            self._closed = True
        self._forget(self.count_sent)
        with self._workers.lock:
            self.changed.notify_all()
            self._workers.look()
