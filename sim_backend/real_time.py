"""Whether a lab that should live in real time does."""

from collections import deque

from onboard.clock import Clock

WARN_BELOW = 0.98
WINDOW_S = 1.0
WARN_PERIOD_S = 5.0


def too_slow(factor: float | None) -> str | None:
    """What to tell the operator of a lab that lives at `factor` of real time (``None``: not known), or
    ``None`` when it is quick enough."""
    if factor is None or factor >= WARN_BELOW:
        return None
    return (
        f"this machine is too busy: the lab runs at {factor:.2f} of real time, and flights in it "
        "are not to be trusted; --pace lockstep waits for everybody"
    )


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
        warning = too_slow(self.recent)
        if warning is None or now - self._warned_at < WARN_PERIOD_S:
            return None
        self._warned_at = now
        return warning
