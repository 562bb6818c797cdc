"""A sign of life ten times a second, by the time that the link goes by.

The answers tell us that the drone is there, and how long it takes to hear of it; to the drone the pings tell
that we are. After 1 s of its time without a packet its firmware drops all log blocks (``radiolink.c``), and
who only listens sends nothing else. cflib's own pings come by the machine's clock: in a lab that is faster
than that, a second of the drone may pass between two of them.
"""

import struct
import threading
from collections import deque
from math import inf

from cflib.crtp.crtpstack import CRTPPacket, CRTPPort

from onboard.closing import Closing
from onboard.link.crazyflie import GuardedCrazyflie
from onboard.link.replies import ECHO_HEADER
from onboard.timebase import Timebase

PERIOD_S = 0.1
_COUNTED = 3
"""Answers of which the quickest counts: one that was held up alone says nothing of the way."""
_PING = struct.Struct("<BI")
_OURS = 1
"""First byte; those of cflib begin with 0."""
_KEPT = 256


class Pings(Closing):
    """Pings on a thread of their own, until the link is lost or closed.

    Args:
        crazyflie: connected.
        clock: the time that the link goes by.
    """

    def __init__(self, crazyflie: GuardedCrazyflie, clock: Timebase) -> None:
        self._crazyflie = crazyflie
        self._clock = clock
        self._closed = clock.event()
        # Guards the three below; held for a few instructions.
        self._lock = threading.Lock()
        self._sent: deque[tuple[int, float]] = deque(maxlen=_KEPT)
        self._round_trips: deque[float] = deque(maxlen=_COUNTED)
        self._latest_answered = clock()
        crazyflie.add_header_callback(self._answered, CRTPPort.LINKCTRL, 0)
        clock.thread(self._run, "LinkPings")

    def round_trip(self) -> float:
        """How long an answer takes at present, s: the drone's other packets wait in the same queue for no
        longer than that. Infinite before the first; it grows where none comes any more."""
        with self._lock:
            unanswered = self._clock() - self._latest_answered - _COUNTED * PERIOD_S
            return max(min(self._round_trips, default=inf), unanswered)

    def close(self) -> None:
        """No ping any more; idempotent."""
        self._closed.set()

    def _run(self) -> None:
        ended, number = self._crazyflie.ended, 0
        while not (self._closed.is_set() or ended.is_set()):
            number = number + 1 & 0xFFFFFFFF
            with self._lock:
                self._sent.append((number, self._clock()))
            self._crazyflie.transmit(CRTPPacket(ECHO_HEADER, _PING.pack(_OURS, number)))
            self._closed.wait(PERIOD_S)

    def _answered(self, packet: CRTPPacket) -> None:
        """Behind all that the drone has sent before, on the thread that takes its other packets, too."""
        payload = bytes(packet.data)
        if len(payload) != _PING.size or payload[0] != _OURS:
            return
        _, number = _PING.unpack(payload)
        with self._lock:
            if number not in (known for known, _ in self._sent):
                return  # a double, or one that was overtaken
            while self._sent:
                known, sent_at = self._sent.popleft()
                if known == number:
                    self._round_trips.append(self._clock() - sent_at)
                    self._latest_answered = sent_at
                    return
