"""Reading the drone's recorder (:mod:`onboard.ring`) over the link, once it has stopped."""

from typing import TYPE_CHECKING

from onboard.app_interface import MEMORY_TYPE_APP, RECORD_ADDRESS
from onboard.link.landing_app import poll
from onboard.ring import (
    HEADER,
    PERIOD,
    PERIODS,
    RING_BYTES,
    Ring,
    RingError,
    check_complete,
    decode_header,
    decode_ring,
    is_complete,
)
from onboard.timebase import WALL, Timebase

if TYPE_CHECKING:
    from onboard.link.drone import DroneLink

STOP_TIMEOUT_S = 2.0
"""The recorder stops 0.3 s after the end of an approach; the rest is for the radio."""


def read_ring(link: "DroneLink", time: Timebase = WALL, within: float = STOP_TIMEOUT_S) -> Ring:
    """Wait until the recorder has stopped, and read it; 13.7 KB, a few seconds over a radio.

    Args:
        link: the open link.
        time: clock and pauses.
        within: deadline for the recorder's stop, s.

    Raises:
        RingError: nothing was recorded, it records still at the deadline, it began anew while it was read, or
            its layout is another.
        NoSuchVariable, CommandRefused, LinkTimeout, LinkLost: as for :meth:`DroneLink.read_memory`.
    """
    header = poll(
        lambda: _read(link, 0, HEADER.itemsize), lambda data: is_complete(decode_header(data)), time, within
    )
    check_complete(decode_header(header))
    held = min(int(decode_header(header)["begun"]), PERIODS)
    periods = [_read(link, HEADER.itemsize + i * PERIOD.itemsize, PERIOD.itemsize) for i in range(held)]
    if _read(link, 0, HEADER.itemsize) != header:
        raise RingError(
            "the drone's recorder began anew while it was read: somebody else has armed an approach"
        )
    return decode_ring((header + b"".join(periods)).ljust(RING_BYTES, b"\0"))


def _read(link: "DroneLink", offset: int, length: int) -> bytes:
    return link.read_memory(MEMORY_TYPE_APP, RECORD_ADDRESS + offset, length)
