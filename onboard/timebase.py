"""Time that can be read and waited for: the machine's own, or that of a simulated lab.

Everything that flies takes its time from one :class:`Timebase` and waits only through what it makes. On
hardware, and in a lab that runs in real time, that is :data:`WALL`: the monotonic clock and the standard
library's events, queues and threads. In a lab that keeps its own time it is
:class:`onboard.lab_time.LabTime`, and the lab goes on only when everything here waits.
"""

import contextlib
import queue
import socket
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any, Protocol


class Event(Protocol):
    """As :class:`threading.Event`."""

    def is_set(self) -> bool:
        """Whether it is set."""

    def set(self) -> None:
        """Set it, and wake who waits."""

    def clear(self) -> None:
        """Reset it."""

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is set, at most `timeout` s; whether it is set."""


class Queue(Protocol):
    """As :class:`queue.Queue`, of which it raises ``Empty`` and ``Full``."""

    def put_nowait(self, item: Any) -> None:
        """Add an item; ``queue.Full`` at the limit."""

    def get_nowait(self) -> Any:
        """The oldest item; ``queue.Empty`` when there is none."""

    def get(self, *, timeout: float | None = None) -> Any:
        """The oldest item, waited for at most `timeout` s; then ``queue.Empty``."""

    def qsize(self) -> int:
        """Number of items."""


class Bell(Protocol):
    """Wakes one thread that has nothing else to do."""

    def ring(self) -> None:
        """Wake it; from any thread, any number of times, also when it is closed. Returns at once."""

    def wait(self) -> bool:
        """Wait for the next ring: several are one. False when it is closed, and was heard out."""

    def close(self) -> None:
        """What was rung until now is the last."""


class Transport(Protocol):
    """The local end of a socket, as the time sees it: packets under way hold a lab's time."""

    def blocking(self) -> AbstractContextManager[None]:
        """Around a call that waits for the socket: waiting is no work."""

    def received(self, packets: int) -> None:
        """Note packets that were taken off the socket, before they are worked on."""

    def sent(self, packets: int) -> None:
        """Note packets that were given to the socket."""

    def close(self) -> None:
        """The socket is closed."""


class Timebase(Protocol):
    """A clock, and whatever waits for it."""

    def __call__(self) -> float:
        """The present time, s; only differences mean anything."""

    def event(self) -> Event:
        """A new event."""

    def queue(self, limit: int = 0) -> Queue:
        """A new queue for at most `limit` items (0: any number)."""

    def bell(self) -> Bell:
        """A new bell. That of the machine's clock has no lock that somebody could hold."""

    def nap(self, seconds: float, at_most: float) -> None:
        """Wait for `seconds`, and no longer than `at_most` s by the machine's clock: for who must go on also
        where this time stands still."""

    def thread(self, target: Callable[..., object], name: str, *args: object) -> threading.Thread:
        """Start a daemon thread that runs ``target(*args)`` and waits through this time only."""

    def foreign(self, thread: threading.Thread | None = None) -> None:
        """A thread that is not of :meth:`thread`, by default the calling one, goes its own way: nothing waits
        for it, until it next waits for something of this time."""

    def transport(self, key: str) -> Transport:
        """A socket's end: ``udp:PORT`` of a drone's link, ``tcp:PORT`` or ``tracker:PORT`` of poses."""

    def connecting(self) -> AbstractContextManager[None]:
        """While a library connects, whose threads nobody counts: a lab does not wait for turns."""

    def patience(self, limit: float) -> float:
        """How long to wait by the machine's clock, s, for what should take `limit` at most: a lab that waits
        for a busy machine is not given up sooner than it gives up itself."""

    def slot(self) -> float:
        """The earliest time to arm: now, or in a lab a time that hangs on no machine's speed."""


class _WallTransport:
    """Real time waits for no packet."""

    def blocking(self) -> AbstractContextManager[None]:
        """Nothing."""
        return nullcontext()

    def received(self, packets: int) -> None:
        """Nothing to note."""

    def sent(self, packets: int) -> None:
        """Nothing to note."""

    def close(self) -> None:
        """Nothing to forget."""


class _SocketBell:
    """A byte through a pair of sockets."""

    def __init__(self) -> None:
        self._hears, self._rings = socket.socketpair()
        self._rings.setblocking(False)

    def ring(self) -> None:
        """One byte."""
        with contextlib.suppress(OSError):  # thousands wait already; or it is closed
            self._rings.send(b"!")

    def wait(self) -> bool:
        """All bytes that are there."""
        if self._hears.recv(4096):
            return True
        self._hears.close()
        self._rings.close()
        return False

    def close(self) -> None:
        """The end, behind the bytes that were sent."""
        with contextlib.suppress(OSError):  # closed before
            self._rings.shutdown(socket.SHUT_WR)


class WallTime:
    """The machine's monotonic clock, the same for all its processes.

    Args:
        clock: another clock to read (waits stay those of the machine).
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock

    def __call__(self) -> float:
        """The clock's time, s."""
        return self._clock()

    def event(self) -> Event:
        """A :class:`threading.Event`."""
        return threading.Event()

    def queue(self, limit: int = 0) -> Queue:
        """A :class:`queue.Queue`."""
        return queue.Queue(limit)

    def bell(self) -> Bell:
        """A pair of sockets."""
        return _SocketBell()

    def nap(self, seconds: float, at_most: float) -> None:
        """Sleep for the shorter of the two."""
        time.sleep(min(seconds, at_most))

    def thread(self, target: Callable[..., object], name: str, *args: object) -> threading.Thread:
        """A daemon thread, started."""
        thread = threading.Thread(target=target, name=name, args=args, daemon=True)
        thread.start()
        return thread

    def foreign(self, thread: threading.Thread | None = None) -> None:
        """Real time waits for no thread."""

    def transport(self, key: str) -> Transport:
        """One that notes nothing."""
        return _WallTransport()

    def connecting(self) -> AbstractContextManager[None]:
        """Nothing changes."""
        return nullcontext()

    def patience(self, limit: float) -> float:
        """So long."""
        return limit

    def slot(self) -> float:
        """Now."""
        return self._clock()


WALL = WallTime()
"""The time of a real run."""
