"""The record of a flight, which may be lost without the flight being lost with it."""

import logging
from collections.abc import Callable, Mapping
from typing import Any

from perchhw.flight.caught import Caught
from perchhw.record import RunRecorder
from perchhw.record.recorder import Scalar

_log = logging.getLogger(__name__)


class FlightRecord:
    """A recorder that never raises: the first failure is kept, and after it nothing more is written.

    May be called from several threads.

    Args:
        recorder: where everything goes.

    Attributes:
        lost: why the record ends early, or None. The supervisor's loop looks at it.
    """

    def __init__(self, recorder: RunRecorder) -> None:
        self._recorder = recorder
        self._closed = False
        self.lost: str | None = None

    def write(self, topic: str, t: float, values: Mapping[str, Scalar]) -> None:
        """As :meth:`RunRecorder.write`."""
        self._try(lambda: self._recorder.write(topic, t, values))

    def event(self, name: str, t: float, **fields: Any) -> None:
        """As :meth:`RunRecorder.event`."""
        self._try(lambda: self._recorder.event(name, t, **fields))

    def update(self, **fields: Any) -> None:
        """As :meth:`RunRecorder.update`."""
        self._try(lambda: self._recorder.update(**fields))

    def close(self, outcome: str | None = None, **result: Any) -> None:
        """As :meth:`RunRecorder.close`; tried even when the rest is lost, for its files are others."""
        self._closed = True  # a packet that comes now is not of this flight
        with Caught(self._lose):
            self._recorder.close(outcome=outcome, record_lost=self.lost, **result)

    def _try(self, write: Callable[[], None]) -> None:
        if self.lost is None and not self._closed:
            with Caught(self._lose):
                write()

    def _lose(self, error: BaseException) -> None:
        if self.lost is not None or (self._closed and self._recorder.closed):
            return  # another thread has told it, or it was still writing when the record was closed
        self.lost = f"{type(error).__name__}: {error}"
        _log.error("the record ends here; the flight goes on to a landing", exc_info=error)
