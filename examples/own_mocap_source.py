"""A mocap source of your own: poses from any tracking system, by an address of its own.

    python examples/own_mocap_source.py

`TrackingSystem` stands for a vendor's SDK; the stream round it is all that perchhw needs. From then on
`tracker://HOST?subject=NAME` is an address in this process, also for `perchhw.fly`. Prints what the health
monitor says after 50 poses. As docs/adding.md adds a source, the command line knows it too.
"""

import math
import time
from typing import Self

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.errors import PoseTimeout
from mocap_bridge.pose import PoseSample, SourceStatistics
from mocap_bridge.uri import SCHEMES, MocapScheme, MocapUri
from onboard.timebase import Timebase


class TrackingSystem:
    """Waits for the next of 100 frames a second: here a body on a circle."""

    def next_frame(self, timeout_s: float) -> tuple[float, float, float] | None:
        """Position in m; None when no frame came in time."""
        time.sleep(min(0.01, timeout_s))
        return 0.5 * math.cos(time.monotonic()), 0.5 * math.sin(time.monotonic()), 1.0


class TrackerStream:
    """The SDK as a ``PoseStream``."""

    def __init__(self, uri: MocapUri, clock: Timebase) -> None:
        self._system, self._uri, self._clock, self._frames = TrackingSystem(), uri, clock, 0

    def read(self, timeout_s: float) -> PoseSample:
        """The next frame; one without the body would be ``occluded``."""
        position = self._system.next_frame(timeout_s)
        if position is None:
            raise PoseTimeout(f"{self._uri}: no frame within {timeout_s:.3g} s")
        self._frames, now = self._frames + 1, self._clock()
        upright = (0.0, 0.0, 0.0, 1.0)
        return PoseSample(self._uri.subject, self._frames, now, now, position, upright, False, None, None)

    def statistics(self) -> SourceStatistics:
        """What is known of the connection."""
        return SourceStatistics(self._frames, (self._uri.subject,))

    def close(self) -> None:
        """End the connection."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


EXAMPLE = "tracker://192.168.1.10?subject=cf1"
SCHEMES["tracker"] = MocapScheme(f"{__name__}.TrackerStream", 4000, EXAMPLE, needs_host=True)

with PoseBridge(EXAMPLE, None) as poses:
    if not poses.wait_for(lambda status: status.health.samples >= 50, 60.0):
        raise SystemExit(f"no poses: {poses.status().error}")
    status = poses.status()
print(f"{status.verdict.value} after {status.health.samples} poses")
