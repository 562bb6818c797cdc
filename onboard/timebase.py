"""Time that can be read and waited for: the machine's own, or that of a simulated lab.

Everything that flies takes its time from one :class:`Timebase` and waits only through what it makes. On
hardware, and in a lab that runs in real time, that is :data:`WALL`: the monotonic clock and the standard
library's events, queues and threads. In a lab that keeps its own time it is
:class:`onboard.lab_time.LabTime`, and the lab goes on only when everything here waits.
"""

import queue
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

    def thread(self, target: Callable[..., object], name: str, *args: object) -> threading.Thread:
        """Start a daemon thread that runs ``target(*args)`` and waits through this time only."""

    def foreign(self) -> None:
        """The calling thread, which is not of :meth:`thread`, goes its own way: nothing waits for it."""

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

    def thread(self, target: Callable[..., object], name: str, *args: object) -> threading.Thread:
        """A daemon thread, started."""
        thread = threading.Thread(target=target, name=name, args=args, daemon=True)
        thread.start()
        return thread

    def foreign(self) -> None:
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
