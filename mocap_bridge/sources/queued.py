"""A source that may bring several samples at once: they wait in a queue until they are read."""

from abc import abstractmethod
from collections import deque
from typing import Self

from mocap_bridge.errors import MocapError, PoseTimeout
from mocap_bridge.pose import PoseSample, SourceStatistics
from mocap_bridge.uri import MocapUri
from onboard.arrays import Quaternion
from onboard.closing import Closing
from onboard.timebase import Timebase


class QueuedStream(Closing):
    """What such sources share (of a ``PoseStream``).

    Args:
        uri: for messages.
        clock: of deadlines and receipt times.
    """

    def __init__(self, uri: MocapUri, clock: Timebase) -> None:
        self._uri, self._clock = uri, clock
        self._samples: deque[PoseSample] = deque()
        self._offered: dict[str, None] = {}
        self._last: Quaternion | None = None
        self._frames = 0
        self._refused = 0

    @abstractmethod
    def find_subject(self, deadline: float) -> None:
        """Receive until the subject is seen; raises a MocapError that says what was seen instead."""

    def opened(self, within_s: float) -> Self:
        """This stream, once its subject is seen; closed where that takes longer than `within_s`."""
        try:
            self.find_subject(self._clock() + within_s)
        except MocapError:
            self.close()
            raise
        return self

    @abstractmethod
    def _receive(self, deadline: float) -> bool:
        """Queue what has arrived, waiting for it until `deadline`; False when that has passed."""

    def read(self, timeout_s: float) -> PoseSample:
        """The next sample; see :meth:`PoseStream.read`."""
        deadline = self._clock() + timeout_s
        while not self._samples:
            if not self._receive(deadline):
                raise PoseTimeout(f"{self._uri}: no pose within {timeout_s:.3g} s")
        return self._samples.popleft()

    def statistics(self) -> SourceStatistics:
        """What is known about the stream so far."""
        return SourceStatistics(self._frames, tuple(self._offered), refused=self._refused)
