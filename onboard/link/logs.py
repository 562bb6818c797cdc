"""Log streams, CRTP port 5: blocks of variables that the drone sends periodically, with its own time.

Channel 1: create ``06 id {type, variable u16}*``, start ``03 id period/10ms``, stop ``04 id``, delete ``02
id`` -> ``command id errno``. Channel 2: ``id, time u24 [ms], values``. The 24-bit time wraps after 4.66 h; it
is unwrapped here.

Up to 9 variables are defined by one packet; the rest of up to 18 by a second, which appends: ``07 id {type,
variable u16}*``. It must not take effect twice, and over a lossy link no one can promise that it arrives
once. So it begins with the largest variable, for which there is no room a second time: the drone then refuses
the copy (E2BIG) before it appends anything.
"""

import errno
import logging
import queue
import struct
import threading
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

from cflib.crtp.crtpstack import CRTPPacket, CRTPPort

from onboard.closing import Closing
from onboard.link.crazyflie import GuardedCrazyflie
from onboard.link.errors import CommandRefused, LinkError, LinkInputError
from onboard.link.exchange import Exchange
from onboard.link.variables import DroneVariable, find
from onboard.timebase import Timebase

BLOCK_BYTES, BLOCKS = 26, 16
PACKET_VARIABLES = 9
BLOCK_VARIABLES = 2 * PACKET_VARIABLES
PERIOD_STEP_MS, PERIOD_MAX_MS = 10, 2540
#: Samples kept for a callback that is slow; then the oldest are dropped and counted.
QUEUE_LIMIT = 256
_SETTINGS, _DATA = 1, 2
_DELETE, _START, _STOP, _CREATE, _APPEND = 2, 3, 4, 6, 7
_HALF = 8
_TIME_RANGE = 1 << 24
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class LogSample:
    """One sample of a block.

    Attributes:
        drone_time_ms: the drone's time since its boot, unwrapped [ms].
        receipt_time: when it arrived, on the link's clock [s].
        values: value by complete name, in the firmware's units.
    """

    drone_time_ms: int
    receipt_time: float
    values: dict[str, float]


def unwrap(known_ms: int | None, raw: int) -> int:
    """The time nearest to ``known_ms`` whose lower 24 bits are ``raw`` [ms]."""
    if known_ms is None:
        return raw
    step = (raw - known_ms) % _TIME_RANGE
    return known_ms + (step if step < _TIME_RANGE // 2 else step - _TIME_RANGE)


class LogStream(Closing):
    """A running stream; a context manager that ends it.

    The callback runs on the stream's own thread, in the drone's order. A sample that was overtaken by a
    younger one is dropped (``late``), as is the oldest when the callback does not keep up (``dropped``). A
    callback that raises ends its stream (``alive`` turns False) and nothing else.
    """

    def __init__(
        self,
        block: int,
        variables: Sequence[DroneVariable],
        callback: Callable[[LogSample], None],
        clock: Timebase,
        end: Callable[["LogStream"], None],
    ) -> None:
        self.block = block
        self.variables = tuple(variables)
        self.late = self.dropped = self.malformed = self.received = 0
        self._callback = callback
        self._clock = clock
        self._end = end
        self._formats = struct.Struct("<" + "".join(variable.format[1:] for variable in variables))
        self._latest: LogSample | None = None
        self._queue = clock.queue(QUEUE_LIMIT)
        self._thread = clock.thread(self._run, f"LogStream-{block}")

    @property
    def latest(self) -> LogSample | None:
        """The youngest sample, or None before the first."""
        return self._latest

    @property
    def alive(self) -> bool:
        """Whether samples are still handed to the callback."""
        return self._thread.is_alive()

    def age(self) -> float:
        """Seconds since the youngest sample arrived; infinite before the first."""
        latest = self._latest
        return float("inf") if latest is None else self._clock() - latest.receipt_time

    def close(self) -> None:
        """Stop the block on the drone and the callbacks here; idempotent."""
        self._end(self)
        self.stop_delivery()

    def stop_delivery(self) -> None:
        """Stop the callbacks only (the link is gone, or about to close)."""
        self._put(None)
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=1.0)

    def receive(self, payload: bytes) -> None:
        """Take one data packet of this block: ``id, time u24, values``."""
        if len(payload) != 4 + self._formats.size:
            self.malformed += 1
            return
        latest = self._latest
        raw_ms = int.from_bytes(payload[1:4], "little")
        time_ms = unwrap(None if latest is None else latest.drone_time_ms, raw_ms)
        if latest is not None and time_ms <= latest.drone_time_ms:
            self.late += 1
            return
        values = self._formats.unpack_from(payload, 4)
        names = (variable.name for variable in self.variables)
        sample = LogSample(time_ms, self._clock(), dict(zip(names, values, strict=True)))
        self._latest = sample
        self.received += 1
        self._put(sample)

    def _put(self, sample: LogSample | None) -> None:
        while True:
            try:
                self._queue.put_nowait(sample)
                return
            except queue.Full:
                self._discard_oldest()

    def _discard_oldest(self) -> None:
        try:
            self._queue.get_nowait()
            self.dropped += 1
        except queue.Empty:
            return  # the callback took it in the meantime

    def _run(self) -> None:
        while (sample := self._queue.get()) is not None:
            self._callback(sample)


class LogStreams:
    """Starts and ends streams, and hands data packets to them."""

    def __init__(
        self,
        crazyflie: GuardedCrazyflie,
        exchange: Exchange,
        table: dict[str, DroneVariable],
        reply_timeout_s: float,
        clock: Timebase,
    ) -> None:
        self._exchange = exchange
        self._table = table
        self._within = reply_timeout_s
        self._clock = clock
        self._lock = threading.Lock()
        self._streams: dict[int, LogStream] = {}
        crazyflie.add_header_callback(self._on_data, CRTPPort.LOGGING, _DATA)

    def __contains__(self, name: str) -> bool:
        return name in self._table

    def start(
        self,
        variables: Sequence[str],
        period_ms: int,
        callback: Callable[[LogSample], None],
        halves: Collection[str] = (),
    ) -> LogStream:
        """Define a block on the drone and start it; `halves` come as FP16, 2 bytes each.

        Raises:
            NoSuchVariable, LinkInputError, CommandRefused, LinkTimeout, LinkLost.
        """
        found = _in_order([self._find(name, name in halves) for name in variables])
        _check_block(found, period_ms)
        with self._lock:
            free = [block for block in range(1, BLOCKS + 1) if block not in self._streams]
            if not free:
                raise LinkInputError(f"the drone has room for {BLOCKS} log streams; close one first")
            stream = LogStream(free[0], found, callback, self._clock, self._end)
            self._streams[stream.block] = stream
        types = [struct.pack("<BH", v.type_code << 4 | _wanted(v), v.ident) for v in found]
        first, second = b"".join(types[:PACKET_VARIABLES]), b"".join(types[PACKET_VARIABLES:])
        try:
            # "Exists" and "too big" are a success: the first copy of this request did its work and its
            # answer was lost.
            self._command(_CREATE, stream.block, first, allowed=(errno.EEXIST,))
            if second:
                self._command(_APPEND, stream.block, second, allowed=(errno.E2BIG,))
            self._command(_START, stream.block, bytes((period_ms // PERIOD_STEP_MS,)))
        except LinkError:
            self._forget(stream)
            stream.stop_delivery()
            raise
        return stream

    def _find(self, name: str, half: bool) -> DroneVariable:
        variable = find(self._table, name, "log variable")
        return replace(variable, format="<e") if half else variable

    def stop_delivery(self) -> None:
        """Stop all callbacks; the drone's blocks end with the connection."""
        with self._lock:
            streams = list(self._streams.values())
            self._streams.clear()
        for stream in streams:
            stream.stop_delivery()

    def _end(self, stream: LogStream) -> None:
        if self._streams.get(stream.block) is not stream:
            return
        try:
            self._command(_STOP, stream.block, b"", allowed=(errno.ENOENT,))
            self._command(_DELETE, stream.block, b"", allowed=(errno.ENOENT,))
        except LinkError as error:
            # Without an answer the block may live on: keep its number taken, so that no other stream gets its
            # data.
            _log.warning("log block %d could not be ended: %s", stream.block, error)
            return
        self._forget(stream)

    def _forget(self, stream: LogStream) -> None:
        with self._lock:
            if self._streams.get(stream.block) is stream:
                del self._streams[stream.block]

    def _command(self, command: int, block: int, rest: bytes, allowed: tuple[int, ...] = ()) -> None:
        head = bytes((command, block))
        reply, _ = self._exchange.ask(
            CRTPPort.LOGGING,
            _SETTINGS,
            head + rest,
            accepts=lambda data: data[:2] == head and len(data) > len(head),
            within=self._within,
            what=f"log command {command} for block {block}",
        )
        status = reply[2]
        if status != 0 and status not in allowed:
            reason = errno.errorcode.get(status, "unknown error")
            raise CommandRefused(
                f"the drone refuses log command {command}, block {block}: {reason} ({status})"
            )

    def _on_data(self, packet: CRTPPacket) -> None:
        payload = bytes(packet.data)
        stream = self._streams.get(payload[0]) if payload else None
        if stream is not None:
            stream.receive(payload)


def _wanted(variable: DroneVariable) -> int:
    """Code of the type that the variable is sent as."""
    return _HALF if variable.format == "<e" else variable.type_code


def _in_order(variables: list[DroneVariable]) -> list[DroneVariable]:
    """With the largest one first in the second packet; see the module's description."""
    if len(variables) <= PACKET_VARIABLES:
        return variables
    others = list(variables)
    largest = others.pop(max(range(len(others)), key=lambda index: others[index].size))
    return [*others[:PACKET_VARIABLES], largest, *others[PACKET_VARIABLES:]]


def _check_block(variables: Sequence[DroneVariable], period_ms: int) -> None:
    size = sum(variable.size for variable in variables)
    if not 1 <= len(variables) <= BLOCK_VARIABLES or size > BLOCK_BYTES:
        raise LinkInputError(
            f"a log stream takes 1 to {BLOCK_VARIABLES} variables and {BLOCK_BYTES} bytes; "
            f"{len(variables)} variables with {size} bytes were asked for. Use several streams."
        )
    if len(variables) > PACKET_VARIABLES and size + variables[PACKET_VARIABLES].size <= BLOCK_BYTES:
        raise LinkInputError(
            f"a log stream of more than {PACKET_VARIABLES} variables leaves less room than its largest one "
            f"takes, so that the drone cannot add variables twice; this one has {size} of {BLOCK_BYTES} "
            "bytes. Use several streams."
        )
    if period_ms % PERIOD_STEP_MS != 0 or not PERIOD_STEP_MS <= period_ms <= PERIOD_MAX_MS:
        raise LinkInputError(
            f"a log period is {PERIOD_STEP_MS}, {2 * PERIOD_STEP_MS} ... {PERIOD_MAX_MS} ms, not {period_ms}"
        )
