"""A sign of life ten times a second, by the time that the link goes by.

The answers tell us that the drone is there; to the drone the pings tell that we are. After 1 s of its time
without a packet its firmware drops all log blocks (``radiolink.c``), and who only listens sends nothing else.
cflib's own pings come by the machine's clock: in a lab that is faster than that, a second of the drone may
pass between two of them.
"""

from cflib.crtp.crtpstack import CRTPPacket

from onboard.closing import Closing
from onboard.link.crazyflie import GuardedCrazyflie
from onboard.link.replies import ECHO_HEADER
from onboard.timebase import Timebase

PERIOD_S = 0.1
_PAYLOAD = b"\0"


class Pings(Closing):
    """Pings on a thread of their own, until the link is lost or closed.

    Args:
        crazyflie: connected.
        clock: the time that the link goes by.
    """

    def __init__(self, crazyflie: GuardedCrazyflie, clock: Timebase) -> None:
        self._crazyflie = crazyflie
        self._closed = clock.event()
        clock.thread(self._run, "LinkPings")

    def close(self) -> None:
        """No ping any more; idempotent."""
        self._closed.set()

    def _run(self) -> None:
        ended = self._crazyflie.ended
        while not (self._closed.is_set() or ended.is_set()):
            self._crazyflie.transmit(CRTPPacket(ECHO_HEADER, _PAYLOAD))
            self._closed.wait(PERIOD_S)
