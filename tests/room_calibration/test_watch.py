"""Waiting for a subject that rests."""

import threading
import time

import pytest

from calibration.room.errors import GeometryRefused
from onboard.timebase import WallTime
from perchhw.mocap_calibration.watch import SubjectWatch
from tests.mavlink.ground import free_port


class SuspendedOnce:
    """A clock by which an hour passes once this thread has asked: ``fg`` long after Ctrl-Z."""

    def __init__(self) -> None:
        self._thread = threading.current_thread()
        self.asked = 0

    def __call__(self) -> float:
        if threading.current_thread() is self._thread:
            self.asked += 1
        return time.monotonic() + (3600.0 if self.asked > 1 else 0.0)


def test_while_the_process_is_suspended_nobody_waits() -> None:
    clock = SuspendedOnce()
    address = f"vicon-udp://127.0.0.1:{free_port()}?subject=cf1"
    with SubjectWatch(address, WallTime(clock)) as watch:
        clock.asked = 0
        with pytest.raises(GeometryRefused, match=r"not seen within 0\.8 s: no good pose"):
            watch.rest(0.8, lambda rest: None)
    assert clock.asked > 2, "it went on waiting afterwards"
