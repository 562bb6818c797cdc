"""Kicks of the drone's emergency-stop watchdog: as long as the supervisor's heart beats, and no longer."""

import logging
from typing import TYPE_CHECKING, Self

from onboard.closing import Closing
from onboard.link.errors import LinkLost
from onboard.timebase import Timebase
from perchhw.flight.caught import Caught

if TYPE_CHECKING:
    from onboard.link import DroneLink

KICK_PERIOD = 0.1
"""s between two kicks; the watchdog bites after 1 s, so nine in a row may be lost."""
HEART_S = 0.3
"""s without a heartbeat after which the supervisor counts as dead: the motors then stop within 1.4 s."""
_log = logging.getLogger(__name__)


class WatchdogKicker(Closing):
    """A thread of its own, so that a send which blocks the supervisor neither starves nor hides it.

    Args:
        link: the open link.
        clock: time of the flight.

    Attributes:
        problem: what went wrong in here, or None. (A lost link the supervisor knows from the link itself.)
    """

    def __init__(self, link: "DroneLink", clock: Timebase) -> None:
        self._link = link
        self._clock = clock
        self._beat_at: float | None = None
        self._ended = clock.event()
        self.problem: str | None = None

    def beat(self, watched: bool) -> None:
        """The supervisor lives; `watched`: in a phase in which a host that dies must stop the drone."""
        self._beat_at = self._clock() if watched else None

    def __enter__(self) -> Self:
        self._clock.thread(self._run, "WatchdogKicker")
        return self

    def close(self) -> None:
        """No kick any more; idempotent."""
        self._ended.set()

    def _run(self) -> None:
        while not self._ended.wait(KICK_PERIOD):
            with Caught(self._failed):
                self._kick()

    def _failed(self, error: BaseException) -> None:
        """An error of ours is for the supervisor, which lands while kicks go on."""
        if not isinstance(error, LinkLost):
            self.problem = f"watchdog kick: {error!r}"
            _log.error("a kick of the drone's watchdog failed", exc_info=error)

    def _kick(self) -> None:
        beat = self._beat_at
        if beat is not None and 0.0 <= self._clock() - beat <= HEART_S:  # a clock that runs back is no heart
            self._link.kick_emergency_stop_watchdog()
