"""Threads that wait for a lab's time: who is at work, who waits for what and until when.

A thread is at work, or it waits in an event or a queue from here. Whoever wakes a thread counts it as at work
before it runs, so that there is no moment in which work exists and nobody is counted for it. Time goes on
when nobody is at work.
"""

import contextlib
import heapq
import itertools
import queue
import threading
from collections import deque
from collections.abc import Callable
from typing import Any


class Waiter:
    """A thread that waits."""

    __slots__ = ("_gate", "woken")

    def __init__(self) -> None:
        self.woken = False
        self._gate = threading.Lock()
        self._gate.acquire()

    def open(self) -> None:
        """Let the thread go on."""
        self._gate.release()

    def pass_gate(self, at_most: float | None = None) -> None:
        """Wait for :meth:`open`, or for so long by the machine's clock, s."""
        self._gate.acquire(timeout=-1 if at_most is None else at_most)


class Workers:
    """Who is at work and who waits, and what time it is; all under one lock.

    Args:
        now: the time, s.
        all_wait: called under the lock when the last has ended its work.

    Attributes:
        now: set by who keeps the time.
        at_work: units of work that are not done.
        takes_turns: packets wait for the turn that they belong to.
    """

    def __init__(self, now: float, all_wait: Callable[[], None]) -> None:
        self.now = now
        self.at_work = 0
        self.takes_turns = True
        self.lock = threading.Lock()
        self._all_wait = all_wait
        self._order = itertools.count()
        self._deadlines: list[tuple[float, int, Waiter]] = []
        self._counted: set[threading.Thread] = set()

    # Work: the caller holds the lock

    def begin(self) -> None:
        """One more unit of work."""
        self.at_work += 1

    def end(self) -> None:
        """One unit of work less."""
        self.at_work -= 1
        self.look()

    def look(self) -> None:
        """Something was done: whether all was."""
        if self.at_work <= 0:
            self._all_wait()

    def block(self, waiters: "set[Waiter]", deadline: float | None, at_most: float | None = None) -> None:
        """Wait until woken, until `deadline`, or for `at_most` s by the machine's clock; the lock is free
        meanwhile."""
        waiter = Waiter()
        waiters.add(waiter)
        if deadline is not None:
            heapq.heappush(self._deadlines, (deadline, next(self._order), waiter))
        if self.discount(threading.current_thread()):
            self.end()
        self.lock.release()
        try:
            waiter.pass_gate(at_most)
        finally:
            self.lock.acquire()
            if not waiter.woken:  # `at_most` came first; or an exception, in the main thread
                waiter.woken = True
                self.begin()
            waiters.discard(waiter)
            self.count()

    def wake(self, waiters: "set[Waiter]") -> None:
        """Wake all of `waiters`, and count them as at work."""
        for waiter in waiters:
            if not waiter.woken:
                self._wake(waiter)

    def next_deadline(self) -> float | None:
        """The earliest time that somebody waits for, or None."""
        while self._deadlines and self._deadlines[0][2].woken:
            heapq.heappop(self._deadlines)
        return self._deadlines[0][0] if self._deadlines else None

    def wake_next_due(self) -> bool:
        """Wake the first whose deadline has come; False when there is none."""
        deadline = self.next_deadline()
        if deadline is None or deadline > self.now:
            return False
        self._wake(heapq.heappop(self._deadlines)[2])
        return True

    def _wake(self, waiter: Waiter) -> None:
        waiter.woken = True
        self.begin()
        waiter.open()

    # The calling thread

    @property
    def counted(self) -> bool:
        """Whether the calling thread is counted as at work."""
        return threading.current_thread() in self._counted

    def count(self) -> None:
        """It is, from here on."""
        self._counted.add(threading.current_thread())

    def discount(self, thread: threading.Thread) -> bool:
        """`thread` is not any more; whether it was."""
        was = thread in self._counted
        self._counted.discard(thread)
        return was


class LabEvent:
    """An event; see :class:`onboard.timebase.Event`."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._set = False
        self._waiters: set[Waiter] = set()

    def is_set(self) -> bool:
        """Whether it is set."""
        return self._set

    def set(self) -> None:
        """Set it, and wake who waits."""
        with self._workers.lock:
            self._set = True
            self._workers.wake(self._waiters)

    def clear(self) -> None:
        """Reset it."""
        with self._workers.lock:
            self._set = False

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is set, at most `timeout` s of the lab."""
        workers = self._workers
        with workers.lock:
            if not self._set and (timeout is None or timeout > 0.0):
                workers.block(self._waiters, None if timeout is None else workers.now + timeout)
            return self._set


class LabQueue:
    """A queue; see :class:`onboard.timebase.Queue`."""

    def __init__(self, workers: Workers, limit: int) -> None:
        self._workers = workers
        self._limit = limit
        self._items: deque[Any] = deque()
        self._waiters: set[Waiter] = set()

    def qsize(self) -> int:
        """Number of items."""
        return len(self._items)

    def put_nowait(self, item: Any) -> None:
        """Add an item.

        Raises:
            queue.Full: at the limit.
        """
        with self._workers.lock:
            if 0 < self._limit <= len(self._items):
                raise queue.Full
            self._items.append(item)
            self._workers.wake(self._waiters)

    def get_nowait(self) -> Any:
        """The oldest item.

        Raises:
            queue.Empty: there is none.
        """
        with self._workers.lock:
            return self._oldest()

    def get(self, *, timeout: float | None = None) -> Any:
        """The oldest item, waited for at most `timeout` s of the lab.

        Raises:
            queue.Empty: none came.
        """
        workers = self._workers
        with workers.lock:
            deadline = None if timeout is None else workers.now + timeout
            while not self._items and (deadline is None or workers.now < deadline):
                workers.block(self._waiters, deadline)
            return self._oldest()

    def _oldest(self) -> Any:
        if not self._items:
            raise queue.Empty
        return self._items.popleft()


class LabBell:
    """A bell; see :class:`onboard.timebase.Bell`. A ring is work from the moment on in which it is rung."""

    def __init__(self, workers: Workers) -> None:
        self._rings = LabQueue(workers, limit=1)
        self._closed = False

    def ring(self) -> None:
        """Wake who waits."""
        with contextlib.suppress(queue.Full):
            self._rings.put_nowait(True)

    def wait(self) -> bool:
        """Wait for the next ring."""
        if self._closed and self._rings.qsize() == 0:
            return False
        return bool(self._rings.get())

    def close(self) -> None:
        """A ring that was not heard yet still is."""
        self._closed = True
        with contextlib.suppress(queue.Full):
            self._rings.put_nowait(False)
