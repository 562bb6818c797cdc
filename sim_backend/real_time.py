"""Whether a lab that should live in real time does."""

from collections import deque

from onboard.clock import Clock

WARN_BELOW = 0.98
WINDOW_S = 1.0
WARN_PERIOD_S = 5.0


class RealTimeFactor:
    """Lab time over real time, over the last second.

    Attributes:
        recent: the factor, or None in the first second.
    """

    def __init__(self, clock: Clock) -> None:
        self.recent: float | None = None
        self._clock = clock
        self._looks: deque[tuple[float, float]] = deque()
        self._warned_at = -WARN_PERIOD_S

    def watch(self, lab_time: float) -> str | None:
        """Note the lab's time; what to tell the operator when it is slow, every 5 s at most."""
        now = self._clock()
        self._looks.append((now, lab_time))
        if now - self._looks[0][0] < WINDOW_S:
            return None
        while now - self._looks[1][0] >= WINDOW_S:
            self._looks.popleft()
        then, lab_then = self._looks[0]
        self.recent = (lab_time - lab_then) / (now - then)
        if self.recent >= WARN_BELOW or now - self._warned_at < WARN_PERIOD_S:
            return None
        self._warned_at = now
        return (
            f"this machine is too busy: the lab runs at {self.recent:.2f} of real time, and flights in it "
            "are not to be trusted; --pace lockstep waits for everybody"
        )
