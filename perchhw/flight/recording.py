"""The record of a flight, which may be lost without the flight being lost with it."""

import logging
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from onboard.errors import PerchhwError
from onboard.record.recorder import Scalar
from perchhw.flight.caught import Caught
from perchhw.record import RunRecorder

_log = logging.getLogger(__name__)


class RecordListener(Protocol):
    """Hears what goes into a record. Must return at once; one that fails is not asked again."""

    def write(self, topic: str, t: float, values: Mapping[str, Scalar]) -> None:
        """As :meth:`RunRecorder.write`."""

    def event(self, name: str, t: float, fields: Mapping[str, Any]) -> None:
        """As :meth:`RunRecorder.event`."""


class FlightRecorder:
    """A recorder that never raises: the first failure is kept, and after it nothing more is written.

    May be called from several threads.

    Args:
        recorder: where everything goes.
        listener: hears it too, also when the record is lost.

    Attributes:
        lost: why the record ends early, or None. The supervisor's loop looks at it.
    """

    def __init__(self, recorder: RunRecorder, listener: RecordListener | None = None) -> None:
        self._recorder = recorder
        self._listener = listener
        self._closed = False
        self._losing = Caught(self._lose)
        self.lost: str | None = None

    def write(self, topic: str, t: float, values: Mapping[str, Scalar]) -> None:
        """As :meth:`RunRecorder.write`."""
        if self.lost is None and not self._closed:
            with self._losing:
                self._recorder.write(topic, t, values)
        if (listener := self._listener) is not None:
            with Caught(self._stop_telling):
                listener.write(topic, t, values)

    def event(self, name: str, t: float, **fields: Any) -> None:
        """As :meth:`RunRecorder.event`."""
        self._try(lambda: self._recorder.event(name, t, **fields))
        if (listener := self._listener) is not None:
            with Caught(self._stop_telling):
                listener.event(name, t, fields)

    def update(self, **fields: Any) -> None:
        """As :meth:`RunRecorder.update`."""
        self._try(lambda: self._recorder.update(**fields))

    def close(self, outcome: str | None = None, **result: Any) -> None:
        """As :meth:`RunRecorder.close`; tried even when the rest is lost, for its files are others."""
        self._closed = True  # a packet that comes now is not of this flight
        with self._losing:
            self._recorder.close(outcome=outcome, record_lost=self.lost, **result)

    def _try(self, write: Callable[[], None]) -> None:
        if self.lost is None and not self._closed:
            with self._losing:
                write()

    def _stop_telling(self, error: BaseException) -> None:
        self._listener = None
        _log.error("nobody is told of this flight any more; it goes on", exc_info=error)

    def _lose(self, error: BaseException) -> None:
        if self.lost is not None or (self._closed and self._recorder.closed):
            return  # another thread has told it, or it was still writing when the record was closed
        ours = isinstance(error, PerchhwError)
        self.lost = str(error) if ours else f"{type(error).__name__}: {error}"
        _log.error(
            "the record ends here (%s); the flight goes on to a landing",
            self.lost,
            exc_info=None if ours else error,
        )
