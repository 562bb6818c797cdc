"""Waiting for as long as a busy machine may need: a deadline here is the end of a test that hangs."""

import threading
import time
from collections.abc import Callable

from onboard.link import DroneLink
from onboard.timebase import WALL, Timebase

PATIENCE_S = 120.0


def until(holds: Callable[[], object]) -> None:
    """Wait until it holds."""
    deadline = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < deadline, "it did not come to pass"
        threading.Event().wait(0.005)


def patient_uri(uri: str, silence_s: float = 15.0) -> str:
    """An address of a drone whose link is not lost when the machine is busy."""
    return f"{uri}?silence_s={silence_s}"


def patient_port(address: str) -> str:
    """An instrument's address whose answers may take as long as the machine is busy."""
    return f"{address}?answer_s=60"


def patient_link(
    uri: str,
    *,
    silence_s: float = PATIENCE_S,
    reply_timeout_s: float = PATIENCE_S,
    clock: Timebase = WALL,
) -> DroneLink:
    """An open link that no delay of the machine breaks."""
    return DroneLink.open(
        patient_uri(uri, silence_s),
        timeout_s=PATIENCE_S,
        reply_timeout_s=reply_timeout_s,
        transfer_timeout_s=PATIENCE_S,
        clock=clock,
    )


class StandingClock:
    """Stands until it is moved."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now
