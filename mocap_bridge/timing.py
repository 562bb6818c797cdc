"""When did the cameras expose? Receipt times are delayed unevenly; frame counters are even.

The exposure time of frame k is taken as ``k * period + offset - round_trip / 2``, where the offset is the
lower envelope (minimum over a window) of ``receipt - reported latency - k * period``: the frames that came
through the network without waiting.
"""

from collections import deque

LATENCY_LIMIT = 0.1
# A window of 5 s keeps the error from clocks that drift by 50 ppm below 0.25 ms.
WINDOW_S = 5.0
# When the last second lies this much above the envelope, the counter paused or restarted: the envelope moves.
RELOCK_WINDOW_S = 1.0
RELOCK_STEP_S = 0.05


def credible_latency(latency: float | None) -> float | None:
    """`latency` (s) when it lies in 0..100 ms; otherwise None: servers in the field send nonsense at
    times."""
    return latency if latency is not None and 0.0 <= latency <= LATENCY_LIMIT else None


class _SlidingMinimum:
    """Minimum of the values of the last `window` seconds, in constant time per value."""

    def __init__(self, window: float) -> None:
        self._window = window
        self._rising: deque[tuple[float, float]] = deque()

    def push(self, time: float, value: float) -> float:
        """Add a value; gives the minimum."""
        rising = self._rising
        while rising and rising[-1][1] >= value:
            rising.pop()
        rising.append((time, value))
        while rising[0][0] < time - self._window:
            rising.popleft()
        return rising[0][1]


class CaptureClock:
    """Estimates exposure times of one source."""

    def __init__(self) -> None:
        self._period = 0.0
        self._last_source_time = -1.0
        self._long = _SlidingMinimum(WINDOW_S)
        self._short = _SlidingMinimum(RELOCK_WINDOW_S)
        self._since = 0.0

    def capture_time(
        self,
        receipt: float,
        source_time: float | None,
        period: float | None,
        latency: float | None,
        delay: float = 0.0,
    ) -> float:
        """Exposure time by the local clock (s).

        Args:
            receipt: local time of the socket read (s).
            source_time: frame number times period (s), None when the source has no period: then the receipt
            time
                minus the latency is all there is.
            period: frame period (s); a change starts the fit afresh.
            latency: credible reported latency (s) or None.
            delay: one-way network delay, half a round trip (s).
        """
        exposure = receipt - (latency or 0.0)
        if source_time is None or period is None:
            return exposure - delay
        if period != self._period or source_time <= self._last_source_time:
            self._restart(receipt, period)
        self._last_source_time = source_time
        offset = exposure - source_time
        envelope = self._long.push(receipt, offset)
        recent = self._short.push(receipt, offset)
        if recent - envelope > RELOCK_STEP_S and receipt - self._since > RELOCK_WINDOW_S:
            self._restart(receipt, period)
            self._long.push(receipt, recent)
            self._short.push(receipt, recent)
            envelope = recent
        return source_time + envelope - delay

    def _restart(self, receipt: float, period: float) -> None:
        self._period = period
        self._long = _SlidingMinimum(WINDOW_S)
        self._short = _SlidingMinimum(RELOCK_WINDOW_S)
        self._since = receipt
