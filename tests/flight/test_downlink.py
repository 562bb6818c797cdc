"""The age of what the drone says counts from when it was said, as far as that can be known."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mocap_bridge.health import PoseVerdict
from onboard.link.drone import LogSample
from onboard.link.logs import unwrap
from perchhw.flight.downlink import DRIFT, USUAL_S, Downlink
from perchhw.flight.readback import ReadBack
from perchhw.flight.telemetry import TEST_FLIGHT_BLOCKS, Telemetry

PERIOD_MS, MINUTES_10 = 10, 600.0
WRAP = 1 << 24


def lates(
    seconds: float,
    delay: Callable[[float], float],
    rate: float = 1.0,
    first_ms: int = 12_345,
    period_ms: int = PERIOD_MS,
) -> list[float]:
    """By how much the messages of a block were late, one a period of a drone's clock that goes at `rate`."""
    downlink, known = Downlink(), None
    result = []
    for count in range(int(1e3 * seconds) // period_ms):
        drone_ms = first_ms + count * period_ms
        sent = 7.0 + 1e-3 * count * period_ms / rate
        known = unwrap(known, drone_ms % WRAP)
        result.append(downlink.late(sent + delay(sent - 7.0), known))
    return result


@pytest.mark.parametrize("rate", [1.0 - DRIFT, 1.0 - 5e-5, 1.0, 1.0 + 5e-5, 1.0 + DRIFT])
def test_nothing_is_late_in_a_quiet_flight_whatever_the_crystals(rate: float) -> None:
    jitter = np.random.default_rng(1).uniform(0.0, 0.9 * USUAL_S, 100_000)
    assert not any(lates(MINUTES_10, lambda t: jitter[int(100.0 * t)], rate, period_ms=50))


@pytest.mark.parametrize("delay", [0.0, 0.3])
def test_a_delay_that_was_always_there_cannot_be_known(delay: float) -> None:
    assert not any(lates(30.0, lambda _t: delay))


def test_a_delay_that_grows_is_counted_whole() -> None:
    late = lates(20.0, lambda t: max(0.0, 0.1 * (t - 10.0)))
    assert not any(late[:1000])
    assert late[-1] == pytest.approx(1.0, abs=0.01)
    assert late[1500] == pytest.approx(0.5, abs=0.01)


def test_a_delay_that_stays_is_not_forgotten_within_a_flight() -> None:
    late = lates(MINUTES_10, lambda t: 1.0 if t > 1.0 else 0.0, period_ms=50)
    assert min(late[100:]) > 1.0 - 1.1 * DRIFT * MINUTES_10


def test_a_delay_that_is_over_is_over() -> None:
    late = lates(10.0, lambda t: 0.5 if 3.0 < t < 4.0 else 0.002)
    assert max(late) == pytest.approx(0.498, abs=0.001)
    assert not any(late[410:])


def test_the_wrap_of_the_time_stamp_is_no_delay() -> None:
    assert not any(lates(10.0, lambda _t: 0.003, first_ms=WRAP - 5_000))


def test_a_clock_that_jumps_back_is_late() -> None:
    downlink = Downlink()
    assert downlink.late(100.0, 90_000) == 0.0
    assert downlink.late(100.01, 50) > 80.0


class Link:
    """One log block in the test's hands, and a round trip."""

    def __init__(self) -> None:
        self.receivers: list[Callable[[LogSample], None]] = []
        self.trip = 0.0

    def has_log(self, _name: str) -> bool:
        """As a drone without our app."""
        return False

    def stream(self, _variables: Any, _period: int, receive: Callable[[LogSample], None], **_: Any) -> None:
        """One more."""
        self.receivers.append(receive)

    def silence(self) -> float:
        """It speaks."""
        return 0.0

    def round_trip(self) -> float:
        """As the test says."""
        return self.trip


class Room:
    """Sees nothing."""

    def status(self) -> Any:
        """As the pose bridge's."""
        return SimpleNamespace(last_good=None, verdict=PoseVerdict.LOST, age=None, error="nobody looks")


@pytest.mark.parametrize(
    ("delay", "trip", "waited"),
    [(0.0, 5.0, 0.0), (0.9 * USUAL_S, 5.0, 0.0), (0.4, 5.0, 0.4), (0.4, 0.05, 0.05), (0.4, 0.0, 0.0)],
)
def test_what_waited_is_older_as_far_as_the_round_trips_bear_it_out(
    delay: float, trip: float, waited: float
) -> None:
    """A lab that falls behind the clock sends what is new, and says when it was by a slow clock."""
    link, nothing = Link(), SimpleNamespace(write=lambda *_: None)
    now = 0.0
    anything: Any = link
    nobody: Any = nothing
    room: Any = Room()
    clock: Any = lambda: now  # noqa: E731
    telemetry = Telemetry(anything, room, nobody, ReadBack(), clock, TEST_FLIGHT_BLOCKS)
    telemetry.start()
    link.trip = trip
    for count in range(100):
        now = 0.01 * count + (delay if count > 50 else 0.0)
        for receive, block in zip(link.receivers, TEST_FLIGHT_BLOCKS, strict=True):
            receive(LogSample(10 * count, now, dict.fromkeys(block.variables, 0.0)))
    received, now = now, now + 0.004
    seen = telemetry.observe()
    for age in (seen.estimate_age, seen.rates_age, seen.drone_age, seen.battery_age):
        assert age == pytest.approx(0.004 + waited, abs=1e-4)
    if not waited:
        assert seen.estimate_age == now - received, "to the last bit"
