"""Time that goes on by what is waited for, for one thread that the test runs itself."""

import threading
from collections.abc import Callable

from onboard.timebase import Event, WallTime


class Stepping(WallTime):
    """Its events are set when it is over.

    Args:
        run_s: how long it goes, s.
        at: called with the time after each wait, before it returns.

    Attributes:
        now: s.
        run: what the last thread would have run, which is not started.
    """

    def __init__(self, run_s: float, at: Callable[[float], None]) -> None:
        self.now = 0.0
        self.run_s = run_s
        self.at = at
        self.run: Callable[..., object] = lambda: None
        super().__init__(lambda: self.now)

    def thread(self, target: Callable[..., object], name: str, *args: object) -> threading.Thread:
        """Not started."""
        self.run = target
        return threading.Thread()

    def event(self) -> Event:
        """One whose waits move time."""
        return _Stepped(self)


class _Stepped(threading.Event):
    def __init__(self, time: Stepping) -> None:
        super().__init__()
        self._time = time

    def is_set(self) -> bool:
        return super().is_set() or self._time.now > self._time.run_s

    def wait(self, timeout: float | None = None) -> bool:
        self._time.now += timeout or 0.0
        self._time.at(self._time.now)
        return self.is_set()
