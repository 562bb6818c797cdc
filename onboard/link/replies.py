"""Which CRTP packets ask for an answer, which answer belongs to which request, and which are duplicates.

CRTP carries no sequence numbers, and over UDP a datagram can be lost, doubled or overtaken. The radio hides
that below CRTP (safelink); cflib therefore treats every reply as the one and only. What goes wrong when it is
not (cflib 0.1.34):

- a second acknowledgement of a memory write pops an empty list while a lock is held: every later write
  deadlocks;
- a second link-source or protocol-version reply starts the download of the tables a second time;
- a late reply to a parameter *read* is taken for the reply to a *write* of the same parameter.

So a reply passes only while a request with the same key is outstanding, and the first reply settles the
request. That is exact, not a time window: two equal replies to two requests both pass, two equal replies to
one request do not. The answer to a write of a parameter repeats all of it: the echo of another value settles
nothing. What writes a value is not settled while a copy of another value may still arrive (:mod:`strays`).

What may legitimately repeat byte for byte passes always: console text, pushed parameter values (``2/3 01``),
the app channel, localization, commander replies, echoes (a raw client may send the same echo many times and
count). Log data is the exception without a request: one block never sends two samples with one timestamp
(periods are >= 10 ms), so an identical packet among the last few is a duplicate.

One ambiguity is left, and no receiver can remove it: a duplicate that is delayed until an identical *new*
request is outstanding. It then answers that request one round trip too early, with content that was true one
request ago. Memory uploads are therefore read back and guarded by a CRC on the drone.
"""

from collections import deque
from dataclasses import dataclass
from typing import Protocol

from onboard.link.strays import LIFETIME_S, StrayCopies

ECHO_HEADER = 0xF0
LOG_DATA_HEADER = 0x52
PARAMETER_WRITE_HEADER = 0x22
PORT_AND_CHANNEL = 0xF3

#: Log packets among which an identical one is a duplicate: 16 blocks at 100 Hz send 16 packets in 10 ms.
LOG_MEMORY = 64
#: A request without an answer is forgotten after this time [s] (firmware never answers a write to a read-only
#: parameter).
FORGET_AFTER = 5.0
#: Bounds of the time before a request is sent again [s].
RESEND_MIN, RESEND_MAX = 0.01, 0.1
#: Before the first round trip was measured [s].
RESEND_FIRST = 0.05
_LATE_IN_A_ROW = 3

# Length of the part of the payload that a request and its reply have in common, by header and command byte.
# Bytes: headers are port << 4 | channel. ``None`` as command stands for "whatever the first byte is".
_KEY_LENGTH: dict[tuple[int, int | None], int] = {
    (0x20, 0x02): 3,  # parameter table: item by id
    (0x20, 0x03): 1,  # parameter table: size and checksum
    (0x21, None): 2,  # parameter read, by id
    (PARAMETER_WRITE_HEADER, None): 2,  # by id
    **{(0x23, command): 3 for command in range(2, 9)},  # extended type, persistence, defaults: by id
    (0x40, 0x01): 1,  # number of memories
    (0x40, 0x02): 2,  # one memory's details
    (0x41, None): 5,  # memory read: id and address
    (0x42, None): 5,  # memory write: id and address
    (0x50, 0x02): 3,  # log table: item by id
    (0x50, 0x03): 1,  # log table: size and checksum
    (0x51, 0x05): 1,  # log reset
    **{(0x51, command): 2 for command in (2, 3, 4, 6, 7, 8)},  # log block commands, by block
    (0x90, None): 1,  # supervisor information
    (0x91, 0x01): 1,  # arm or disarm
    (0x91, 0x02): 1,  # recover
    **{(0xD1, command): 1 for command in (0, 1, 2)},  # protocol and firmware version, device name
    (0xF1, None): 0,  # link source
}
#: Of these a late copy undoes what was written after it: parameters, memory, arming.
_WRITES = (b"\x22", b"\x42", b"\x91\x01")
_SUPERVISOR_HEADERS = (0x90, 0x91)
_SUPERVISOR_REPLY_BIT = 0x80


class CrtpPacket(Protocol):
    """The part of cflib's ``CRTPPacket`` that is used here."""

    header: int
    data: bytearray


def reply_key(header: int, payload: bytes | bytearray) -> bytes | None:
    """What a request and its reply have in common.

    Args:
        header: CRTP header; the two link bits are ignored.
        payload: the bytes after the header, of the request or of the reply.

    Returns:
        The key, or ``None`` for packets that ask for no answer or whose answers may repeat.
    """
    header &= PORT_AND_CHANNEL
    command = payload[0] if payload else None
    if header in _SUPERVISOR_HEADERS and command is not None:
        command &= ~_SUPERVISOR_REPLY_BIT
    length = _KEY_LENGTH.get((header, command), _KEY_LENGTH.get((header, None)))
    if length is None or len(payload) < length:
        return None
    if header in _SUPERVISOR_HEADERS:
        return bytes((header, command or 0))
    return bytes((header,)) + bytes(payload[:length])


@dataclass(slots=True)
class _Request:
    packet: CrtpPacket
    first_sent: float
    interval: float
    safe_at: float
    due: float = 0.0
    last_sent: float = 0.0
    last_too_early: float = float("-inf")
    sends: int = 0
    answers: int = 0

    @property
    def payload(self) -> bytes:
        return bytes(self.packet.data)

    def sent(self, now: float) -> None:
        self.sends += 1
        self.last_sent = now
        if now < self.safe_at:
            self.last_too_early = now

    def answered(self, now: float) -> bool:
        """Whether what it wrote stays: this can only answer a copy that left when all strays had ended."""
        self.answers += 1
        sure_at = self.last_too_early + LIFETIME_S
        if now < sure_at:
            self.due = max(self.due, sure_at)
        return now >= sure_at


class OutstandingRequests:
    """Requests without an answer yet: says what to send again and which replies to let through.

    Not thread-safe; the driver holds its lock.
    """

    def __init__(self) -> None:
        self._requests: dict[bytes, _Request] = {}
        self._strays = StrayCopies()
        self._log_packets: deque[bytes] = deque(maxlen=LOG_MEMORY)
        self._round_trip: float | None = None
        self._unmeasured = 0  # answers in a row to more than one copy

    def __len__(self) -> int:
        return len(self._requests)

    @property
    def doubled(self) -> bool:
        """Whether the network has shown that it doubles datagrams."""
        return self._strays.doubled

    def sending(self, packet: CrtpPacket, now: float) -> bool:
        """Note that a client sends ``packet`` at ``now`` [s]; True for a request that is watched now."""
        key = reply_key(packet.header, packet.data)
        if key is None:
            return False
        known = self._requests.get(key)
        if known is not None and known.packet is packet:
            known.sent(now)  # the client sends it again by itself
            return True
        # All these protocols are lock-step per key: a new request means that the client gave up the old one.
        if known is not None:
            self._leave(key, known, now)
        interval = self._first_interval()
        undone_until = self._strays.threaten(key, bytes(packet.data), now) if key.startswith(_WRITES) else now
        self._requests[key] = request = _Request(packet, now, interval, undone_until, now + interval)
        request.sent(now)
        return True

    def accept(self, datagram: bytes, now: float) -> bool:
        """Whether the received ``datagram`` goes to the client; False for a duplicate."""
        header, payload = datagram[0], datagram[1:]
        if header & PORT_AND_CHANNEL == LOG_DATA_HEADER:
            if datagram in self._log_packets:
                return False
            self._log_packets.append(datagram)
            return True
        key = reply_key(header, payload)
        if key is None:
            return True
        request = self._requests.get(key)
        if request is None:
            self._strays.came_home(key, now)
            return False
        if header & PORT_AND_CHANNEL == PARAMETER_WRITE_HEADER and payload != request.payload:
            return False
        if not request.answered(now):
            return False
        del self._requests[key]
        self._leave(key, request, now)
        if request.sends == 1:  # otherwise it is unknown which of the sends was answered (Karn's rule)
            self._measure(now - request.first_sent)
            self._unmeasured = 0
        else:
            self._unmeasured += 1
        return True

    def due(self, now: float) -> list[CrtpPacket]:
        """Packets to send again at ``now`` [s]. Each wait is twice the one before, up to the longest."""
        packets = []
        for key, request in list(self._requests.items()):
            if now - request.first_sent > FORGET_AFTER:
                del self._requests[key]
            elif now >= request.due:
                request.sent(now)
                request.interval = min(2 * request.interval, RESEND_MAX)
                request.due = now + request.interval
                packets.append(request.packet)
        return packets

    def next_due(self) -> float | None:
        """When :meth:`due` will next have something to send or to forget [s], or None."""
        return min((min(r.due, r.first_sent + FORGET_AFTER) for r in self._requests.values()), default=None)

    def _leave(self, key: bytes, request: _Request, now: float) -> None:
        self._strays.left(key, request.payload, request.sends - request.answers, request.last_sent, now)

    def _first_interval(self) -> float:
        """Longer when answers come late again and again: then too soon may be why none can be measured."""
        known = RESEND_FIRST if self._round_trip is None else max(4 * self._round_trip, RESEND_MIN)
        return min(known * 2.0 ** min(self._unmeasured // _LATE_IN_A_ROW, 4), RESEND_MAX)

    def _measure(self, round_trip: float) -> None:
        known = self._round_trip
        self._round_trip = round_trip if known is None else 0.875 * known + 0.125 * round_trip
