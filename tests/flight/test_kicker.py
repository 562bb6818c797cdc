"""The drone's watchdog is kicked as long as the supervisor's heart beats, and no longer."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from onboard.link.errors import LinkLost
from perchhw.flight.kicker import HEART_S, KICK_PERIOD, WatchdogKicker
from tests.stepped_time import Stepping

RUN_S = 2.0
SOME_US = 1e-6


class Drone:
    """Notes when it is kicked."""

    def __init__(self) -> None:
        self.clock: Callable[[], float] = lambda: 0.0
        self.kicks: list[float] = []
        self.fails: Exception | None = None

    def kick_emergency_stop_watchdog(self) -> None:
        """Note it."""
        if self.fails is not None:
            raise self.fails
        self.kicks.append(self.clock())


def kicked(beats: Callable[[WatchdogKicker, float], None]) -> tuple[Drone, WatchdogKicker]:
    """What came of :data:`RUN_S` with a heart that beats like this: called before every look at it."""
    drone = Drone()
    link: Any = drone
    time = Stepping(RUN_S, lambda now: beats(kicker, now))
    drone.clock = time
    kicker = WatchdogKicker(link, time)
    with kicker:
        time.run()
    return drone, kicker


def test_every_period_while_the_heart_beats() -> None:
    drone, _ = kicked(lambda kicker, _now: kicker.beat(True))
    assert len(drone.kicks) == pytest.approx(RUN_S / KICK_PERIOD, abs=1)


@pytest.mark.parametrize("last_beat", [0.5, 1.0])
def test_no_longer_than_the_heart_counts_as_beating(last_beat: float) -> None:
    """A supervisor that hangs, or is suspended, must not keep its drone in the air."""
    drone, _ = kicked(lambda kicker, now: kicker.beat(True) if now < last_beat + SOME_US else None)
    assert last_beat < max(drone.kicks) <= last_beat + HEART_S + SOME_US


def test_again_when_it_beats_again() -> None:
    drone, _ = kicked(lambda kicker, now: kicker.beat(True) if not 0.5 < now < 1.5 else None)
    gaps = [later - earlier for earlier, later in pairwise(drone.kicks)]
    assert max(gaps) > 1.5 - 0.5 - HEART_S - 2.0 * KICK_PERIOD
    assert max(drone.kicks) > 1.9


def test_not_in_a_phase_that_is_not_watched_nor_before_the_first_beat() -> None:
    drone, _ = kicked(lambda kicker, now: kicker.beat(0.5 < now < 1.0) if now > 0.5 else None)
    assert min(drone.kicks) > 0.5
    assert max(drone.kicks) < 1.0 + SOME_US


@pytest.mark.parametrize(("error", "told"), [(OSError("broken"), True), (LinkLost("gone"), False)])
def test_an_error_of_ours_is_told_and_a_lost_link_is_not(error: Exception, told: bool) -> None:
    """That one the supervisor knows from the link itself."""
    drone = Drone()
    drone.fails = error
    link: Any = drone
    time = Stepping(RUN_S, lambda _now: kicker.beat(True))
    kicker = WatchdogKicker(link, time)
    with kicker:
        time.run()
    assert (kicker.problem is not None) is told
