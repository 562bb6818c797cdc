"""Requests and their answers on an open link: a deadline on every wait, and every wait ends when the link
does.

cflib's own layers above the packets are not used once the connection stands: they have no deadlines, return
stale values, and answer a lost reply by waiting for ever.
"""

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cflib.crtp.crtpstack import CRTPPacket

from onboard.link.crazyflie import GuardedCrazyflie
from onboard.link.deadline import GrowingDeadline
from onboard.link.errors import LinkLost, LinkTimeout, Superseded
from onboard.link.replies import FORGET_AFTER
from onboard.timebase import Event, Timebase

#: Interval of resending for links without a reliable transport of their own [s].
RETRY_S = 0.2
#: Questions under way at once: the drone's queue for what it receives holds five (``radiolink.c``), and a
#: full one restarts it.
UNDER_WAY = 4
_log = logging.getLogger(__name__)


def always() -> bool:
    """Of a request that is wanted whatever happens."""
    return True


@dataclass(slots=True, eq=False)
class _Waiter:
    port: int
    channel: int
    accepts: Callable[[bytes], bool]
    event: Event
    write: tuple[bytes, bytes] | None = None  # where to, and all of it
    reply: bytes | None = None
    superseded: bool = False

    def undoes(self, other: "_Waiter") -> bool:
        """Whether this writes something else to where the other one writes to."""
        if self.write is None or other.write is None:
            return False
        return self.write[0] == other.write[0] and self.write != other.write


class Query(NamedTuple):
    """A request, and what its answer begins with.

    Attributes:
        port: CRTP port.
        channel: CRTP channel.
        payload: up to 30 bytes.
        key: bytes of the payload that the answer repeats.
        length: least bytes of the answer.
    """

    port: int
    channel: int
    payload: bytes
    key: int
    length: int


@dataclass(slots=True, eq=False)
class _Asked:
    number: int
    packet: CRTPPacket
    waiter: _Waiter
    first_sent: float
    last_sent: float


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
        crazyflie.packet_received.add_callback(self._deliver)

    @property
    def lost(self) -> LinkLost | None:
        """Why the link broke, or None while it stands."""
        return self._lost

    def silence(self) -> float:
        """Seconds since the last packet from the drone."""
        last = self._last_packet  # before the clock: one that comes in between would be of the future
        return self._clock() - last

    def send(self, port: int, channel: int, payload: bytes) -> None:
        """Send one packet that asks for no answer (over the radio this waits for its turn, at most 20 ms).

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
        place: bytes | None = None,
        wanted: Callable[[], bool] = always,
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
            place: what is written to, if it is a write: a write of something else to it that another thread
                waits for is given up, for no driver repeats both.
            wanted: asked before this gives up anything else, and before each copy. Once it says no, none
                leaves any more, but one that a thread of this moment has in its hands.

        Raises:
            LinkTimeout: no answer by the deadline.
            Superseded: another thread wrote to the same place before this was answered, or it is not wanted.
            LinkLost: the link is gone, or went while waiting.
        """
        packet = CRTPPacket(port << 4 | channel, payload)
        write = None if place is None else (place, payload)
        waiter = _Waiter(port, channel, accepts, self._clock.event(), write)
        link = self._crazyflie.link
        if retry_s is None and link is not None and link.needs_resending:
            retry_s = RETRY_S
        deadline = self._clock() + within
        self._wait_for(waiter, wanted, what)
        try:
            self._check_open()
            self._crazyflie.transmit(packet)
            copies = 1
            while not waiter.event.wait(max(0.0, min(deadline - self._clock(), retry_s or within))):
                if self._clock() >= deadline:
                    raise LinkTimeout(f"{self._uri} did not answer within {within:g} s: {what}")
                _require(wanted, what)
                if retry_s is not None:
                    self._crazyflie.transmit(packet)
                    copies += 1
        finally:
            with self._lock:
                self._waiters.remove(waiter)
        if waiter.reply is None:
            self._check_open()
            if waiter.superseded:
                raise Superseded(f"another thread wrote something else meanwhile: {what}")
            raise LinkLost(f"the link to {self._uri} broke while waiting: {what}")
        return Answer(waiter.reply, copies)

    def _wait_for(self, waiter: _Waiter, wanted: Callable[[], bool], what: str) -> None:
        """Wait for its answer from now on, and no longer for that of a write which it undoes.

        Under the lock: what took its place before was there only after this was no longer wanted.
        """
        with self._lock:
            _require(wanted, what)
            for other in filter(waiter.undoes, self._waiters):
                other.superseded = True
                other.event.set()
            self._waiters.append(waiter)

    def ask_all(
        self, questions: Sequence[Query], *, time: Timebase, deadline: GrowingDeadline, what: str
    ) -> list[bytes]:
        """Send requests, some at once, until all have their answers; these, in the same order.

        Args:
            questions: no two with the same beginning of an answer.
            time: what `deadline` and repetitions go by.
            deadline: when to give up; it is told of these questions, and of each answer.
            what: what is asked for, for the error message.

        Raises:
            LinkTimeout: not all answers by the deadline.
            LinkLost: the link is gone, or went while waiting.
        """
        deadline.expect(len(questions))
        answers = [b""] * len(questions)
        something, unasked = time.event(), list(enumerate(questions))[::-1]
        under_way: list[_Asked] = []
        try:
            while unasked or under_way:
                self._check_open()
                while unasked and len(under_way) < UNDER_WAY:
                    under_way.append(self._begin(*unasked.pop(), something, time()))
                now = time()
                if now >= deadline.at:
                    late = now - deadline.began
                    raise LinkTimeout(f"{self._uri} did not answer within {late:.3g} s: {what}")
                repeat = self._send_again(under_way, now)
                something.wait(min(repeat, deadline.at - now))
                something.clear()
                for asked in [asked for asked in under_way if asked.waiter.reply is not None]:
                    answers[asked.number] = asked.waiter.reply or b""
                    deadline.answered(time() - asked.first_sent)
                    self._end(asked)
                    under_way.remove(asked)
        finally:
            for asked in under_way:
                self._end(asked)
        return answers

    def _begin(self, number: int, question: Query, something: Event, now: float) -> _Asked:
        port, channel, payload, key, length = question
        start = payload[:key]
        waiter = _Waiter(port, channel, lambda d: d[:key] == start and len(d) >= length, something)
        packet = CRTPPacket(port << 4 | channel, payload)
        with self._lock:
            self._waiters.append(waiter)
        self._crazyflie.transmit(packet)
        return _Asked(number, packet, waiter, now, now)

    def _end(self, asked: _Asked) -> None:
        with self._lock:
            self._waiters.remove(asked.waiter)

    def _send_again(self, under_way: list[_Asked], now: float) -> float:
        """Repeat what the driver does not, or does no longer; seconds until the next is due."""
        link = self._crazyflie.link
        period = RETRY_S if link is not None and link.needs_resending else FORGET_AFTER
        for asked in under_way:
            if now - asked.last_sent >= period:
                asked.last_sent = now
                self._crazyflie.transmit(asked.packet)
        return min(asked.last_sent for asked in under_way) + period - now

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

    def _deliver(self, packet: CRTPPacket) -> None:
        self._last_packet = self._clock()
        payload = bytes(packet.data)
        with self._lock:
            waiters = [w for w in self._waiters if w.port == packet.port and w.channel == packet.channel]
        for waiter in waiters:
            if waiter.reply is None and waiter.accepts(payload):
                waiter.reply = payload
                waiter.event.set()


def _require(wanted: Callable[[], bool], what: str) -> None:
    if not wanted():
        raise Superseded(f"it is no longer wanted: {what}")
