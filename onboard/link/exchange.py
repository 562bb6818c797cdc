"""Requests and their answers on an open link: a deadline on every wait, and every wait ends when the link
does.

cflib's own layers above the packets are not used once the connection stands: they have no deadlines, return
stale values, and answer a lost reply by waiting for ever.
"""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from cflib.crtp.crtpstack import CRTPPacket, CRTPPort

from onboard.link.crazyflie import GuardedCrazyflie
from onboard.link.errors import LinkLost, LinkTimeout
from onboard.timebase import Event, Timebase

#: Interval of resending for links without a reliable transport of their own [s].
RETRY_S = 0.2
_PORTS = (
    CRTPPort.PARAM,
    CRTPPort.MEM,
    CRTPPort.LOGGING,
    CRTPPort.SETPOINT_HL,
    CRTPPort.SUPERVISOR,
)
_log = logging.getLogger(__name__)


@dataclass(slots=True, eq=False)
class _Waiter:
    port: int
    channel: int
    accepts: Callable[[bytes], bool]
    event: Event
    reply: bytes | None = None


class Answer(NamedTuple):
    """An answer.

    Attributes:
        payload: without the header.
        copies: how often the request was sent before.
    """

    payload: bytes
    copies: int


class Exchange:
    """Sends packets and waits for the packets that answer them. Methods may be called from any thread."""

    def __init__(self, crazyflie: GuardedCrazyflie, uri: str, clock: Timebase) -> None:
        self._crazyflie = crazyflie
        self._uri = uri
        self._clock = clock
        self._lock = threading.Lock()
        self._waiters: list[_Waiter] = []
        self._lost: LinkLost | None = None
        self._closed = False
        self._last_packet = clock()
        crazyflie.packet_received.add_callback(self._note_packet)
        for port in _PORTS:
            crazyflie.add_port_callback(port, self._deliver)

    @property
    def lost(self) -> LinkLost | None:
        """Why the link broke, or None while it stands."""
        return self._lost

    def silence(self) -> float:
        """Seconds since the last packet from the drone."""
        return self._clock() - self._last_packet

    def send(self, port: int, channel: int, payload: bytes) -> None:
        """Send one packet that asks for no answer (over the radio this waits for its turn, at most 2 s).

        Raises:
            LinkLost: the link is gone or closed.
        """
        self._check_open()
        self._crazyflie.transmit(CRTPPacket(port << 4 | channel, payload))

    def ask(
        self,
        port: int,
        channel: int,
        payload: bytes,
        *,
        accepts: Callable[[bytes], bool],
        within: float,
        what: str,
        retry_s: float | None = None,
    ) -> Answer:
        """Send a request; its answer, and how often it was sent.

        Args:
            port: CRTP port.
            channel: CRTP channel.
            payload: up to 30 bytes.
            accepts: whether a payload on this port and channel is the answer.
            within: deadline [s].
            what: what is asked for, for the error message.
            retry_s: repeat the request this often [s]. None: only if neither the driver nor the radio does
                it.

        Raises:
            LinkTimeout: no answer by the deadline.
            LinkLost: the link is gone, or went while waiting.
        """
        packet = CRTPPacket(port << 4 | channel, payload)
        waiter = _Waiter(port, channel, accepts, self._clock.event())
        link = self._crazyflie.link
        if retry_s is None and link is not None and link.needs_resending:
            retry_s = RETRY_S
        deadline = self._clock() + within
        with self._lock:
            self._waiters.append(waiter)
        try:
            self._check_open()
            self._crazyflie.transmit(packet)
            copies = 1
            while not waiter.event.wait(max(0.0, min(deadline - self._clock(), retry_s or within))):
                if self._clock() >= deadline:
                    raise LinkTimeout(f"{self._uri} did not answer within {within:g} s: {what}")
                if retry_s is not None:
                    self._crazyflie.transmit(packet)
                    copies += 1
        finally:
            with self._lock:
                self._waiters.remove(waiter)
        if waiter.reply is None:
            self._check_open()
            raise LinkLost(f"the link to {self._uri} broke while waiting: {what}")
        return Answer(waiter.reply, copies)

    def fail(self, reason: str) -> None:
        """The link is gone: remember why, and end every wait."""
        with self._lock:
            if self._lost is not None or self._closed:
                return
            self._lost = LinkLost(f"the link to {self._uri} is lost: {reason}")
        _log.info("%s", self._lost)
        self._wake_all()

    def close(self) -> None:
        """No further packets; every wait ends."""
        with self._lock:
            self._closed = True
        self._wake_all()

    def _wake_all(self) -> None:
        with self._lock:
            for waiter in self._waiters:
                waiter.event.set()

    def _check_open(self) -> None:
        if self._lost is not None:
            raise LinkLost(str(self._lost))
        if self._closed:
            raise LinkLost(f"the link to {self._uri} was closed")

    def _note_packet(self, _packet: CRTPPacket) -> None:
        self._last_packet = self._clock()

    def _deliver(self, packet: CRTPPacket) -> None:
        payload = bytes(packet.data)
        with self._lock:
            waiters = [w for w in self._waiters if w.port == packet.port and w.channel == packet.channel]
        for waiter in waiters:
            if waiter.reply is None and waiter.accepts(payload):
                waiter.reply = payload
                waiter.event.set()
