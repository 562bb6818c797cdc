"""The record of a flight, which may be lost without the flight being lost with it."""

import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping
from time import monotonic
from types import TracebackType
from typing import Any, Protocol, Self

from onboard.errors import PerchhwError
from onboard.record.recorder import Scalar
from perchhw.flight.caught import Caught
from perchhw.record import RunRecorder

WRITE_EVERY_S = 0.02
"""How long what was given waits to be written at most, s: so much a killed process loses."""
STUCK_S = 5.0
"""A disk that has taken nothing for so long, s, takes no more: the flight lands before memory fills."""
_LOOKS = 50
"""At one write before it is stuck: a second of the supervisor's, which a resumed process has not had yet."""
_LOOK_S = 0.02
"""Between two looks of who waits for the record, s: as the supervisor's."""
_log = logging.getLogger(__name__)


class RecordListener(Protocol):
    """Hears what goes into a record. Must return at once; one that fails is not asked again."""

    def write(self, topic: str, t: float, values: Mapping[str, Scalar]) -> None:
        """As :meth:`RunRecorder.write`."""

    def event(self, name: str, t: float, fields: Mapping[str, Any]) -> None:
        """As :meth:`RunRecorder.event`."""


class FlightRecorder:
    """A recorder that never raises, and that nobody waits for: a thread of its own writes what it was given,
    every 20 ms. A disk that stands still must hold up neither the supervisor nor the poses. The first failure
    is kept, and after it nothing more is written.

    May be called from several threads. As a context manager it has everything written on the way out.

    Args:
        recorder: where everything goes.
        listener: hears it too, at once, also when the record is lost.
    """

    def __init__(self, recorder: RunRecorder, listener: RecordListener | None = None) -> None:
        self._recorder = recorder
        self._listener = listener
        self._closed = False
        self._losing = Caught(self._lose)
        self._lost: str | None = None
        # A deque and no queue: whoever flies adds to it without a lock that the writer could hold.
        self._waiting: deque[Callable[[], object]] = deque()
        self._wake = threading.Event()
        self._ended = False
        self._stuck = _StuckWrite()
        self._writer = threading.Thread(target=self._write_on, name="FlightRecorder", daemon=True)
        self._writer.start()

    def look_for_loss(self) -> str | None:
        """Look whether the disk stands still; gives why the record ends early, or None. For the supervisor's
        loop, at each of its turns: how often was looked counts, too.
        """
        if self._lost is None and self._stuck.look():
            self._lost = f"the disk has taken nothing for {STUCK_S:g} s; look at it before the next flight"
            _log.error("the record ends here (%s); the flight goes on to a landing", self._lost)
        return self._lost

    def write(self, topic: str, t: float, values: Mapping[str, Scalar]) -> None:
        """As :meth:`RunRecorder.write`."""
        kept = dict(values)
        self._later(lambda: self._recorder.write(topic, t, kept))
        if (listener := self._listener) is not None:
            with Caught(self._stop_telling):
                listener.write(topic, t, values)

    def event(self, name: str, t: float, **fields: Any) -> None:
        """As :meth:`RunRecorder.event`."""
        self._later(lambda: self._recorder.event(name, t, **fields))
        if (listener := self._listener) is not None:
            with Caught(self._stop_telling):
                listener.event(name, t, fields)

    def update(self, **fields: Any) -> None:
        """As :meth:`RunRecorder.update`."""
        self._later(lambda: self._recorder.update(**fields))

    def settle(self) -> bool:
        """Wait until what was given is with the operating system; False where the disk stands still."""
        written = threading.Event()
        self._waiting.append(written.set)
        self._wake.set()
        while not written.wait(_LOOK_S):
            if self.look_for_loss() is not None and self._stuck.look():
                return False
        return True

    def close(self, outcome: str | None = None, **result: Any) -> None:
        """As :meth:`RunRecorder.close`; tried even when the rest is lost, for its files are others."""
        self._closed = True  # a packet that comes now is not of this flight
        if self.settle():
            with self._losing:
                self._recorder.close(outcome=outcome, record_lost=self._lost, **result)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.settle()
        self._ended = True
        self._wake.set()

    def _later(self, call: Callable[[], object]) -> None:
        if self._lost is None and not self._closed:
            self._waiting.append(call)

    def _write_on(self) -> None:
        while not self._ended:
            self._wake.wait(WRITE_EVERY_S)
            self._wake.clear()
            while self._waiting:
                with self._stuck, self._losing:
                    self._waiting.popleft()()

    def _stop_telling(self, error: BaseException) -> None:
        self._listener = None
        _log.error("nobody is told of this flight any more; it goes on", exc_info=error)

    def _lose(self, error: BaseException) -> None:
        if self._lost is not None or (self._closed and self._recorder.closed):
            return  # told already, or written when the record was closed
        ours = isinstance(error, PerchhwError)
        self._lost = str(error) if ours else f"{type(error).__name__}: {error}"
        _log.error(
            "the record ends here (%s); the flight goes on to a landing",
            self._lost,
            exc_info=None if ours else error,
        )


class _StuckWrite:
    """Whether a write that is under way, entered by the writer, has taken too long.

    Whoever looks must have seen the same write many times: a process that was suspended in the middle of one
    has a slow clock, not a slow disk.
    """

    def __init__(self) -> None:
        self._began: float | None = None
        self._seen: float | None = None
        self._looks = 0

    def __enter__(self) -> None:
        self._began = monotonic()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._began = None

    def look(self) -> bool:
        """Whether it is stuck."""
        began = self._began
        if began is None or began != self._seen:
            self._seen, self._looks = began, 0
            return False
        self._looks += 1
        return self._looks > _LOOKS and monotonic() - began > STUCK_S
