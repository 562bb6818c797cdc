"""Waits until a subject rests somewhere new, and gives what was seen of it."""

from collections import deque
from collections.abc import Callable

import numpy as np

from calibration.room.errors import GeometryRefused
from calibration.room.marker_body import Rest
from mocap_bridge.bridge import PoseBridge
from mocap_bridge.health import PoseVerdict
from mocap_bridge.pose import PoseSample
from onboard.closing import Closing
from onboard.timebase import Timebase

REST_S = 2.0
_LOOK_S = 0.1
_LONGEST_LOOK_S = 0.5
"""Of a longer one this much counts as waited: the process was suspended (Ctrl-Z), and nobody looked."""
_KEPT = 4000


class SubjectWatch(Closing):
    """Good poses of one subject as it is tracked, uncorrected.

    Args:
        uri: of its poses.
        time: the time that is waited in.
    """

    def __init__(self, uri: str, time: Timebase) -> None:
        self._uri, self._time = uri, time
        self._samples: deque[PoseSample] = deque(maxlen=_KEPT)
        self._bridge = PoseBridge(uri, sink=None, clock=time, on_sample=self._take)
        self._bridge.start()

    def _take(self, sample: PoseSample, verdict: PoseVerdict) -> None:
        if verdict is PoseVerdict.OK and sample.position is not None:
            self._samples.append(sample)

    def rest(self, within: float, refuse: Callable[[Rest], str | None]) -> Rest:
        """The next 2 s in which the subject rests, in a place that is not refused.

        Args:
            within: s to wait, but for those in which this process is suspended.
            refuse: why a rest is not the one that is waited for, or None.

        Raises:
            GeometryRefused: none came; the message has what was seen last.
        """
        begin = looked = self._time()
        waited = 0.0
        problem = f"no good pose of {self._uri}"
        while waited < within:
            self._time.event().wait(_LOOK_S)
            now = self._time()
            waited += min(now - looked, _LONGEST_LOOK_S)
            looked = now
            recent = [s for s in list(self._samples) if s.receipt_time >= max(begin, now - REST_S)]
            if not recent or now - begin < REST_S or recent[0].receipt_time > now - REST_S + 0.2:
                continue
            try:
                rest = Rest.of(
                    np.array([sample.position for sample in recent]),
                    np.array([sample.quaternion for sample in recent]),
                )
            except GeometryRefused as moved:
                problem = str(moved)
                continue
            refused = refuse(rest)
            if refused is None:
                return rest
            problem = refused
        raise GeometryRefused(f"not seen within {within:g} s: {problem}")

    def close(self) -> None:
        """Stop listening."""
        self._bridge.stop()
