"""The line protocol of our tachometer and load cell: bytes in, typed lines and counted faults out. Pure.

ASCII, 115200 baud, one line each, LF or CRLF::

    I,<proto>,<tach|load>,<firmware>,<uid>,<tick_us>*HH    banner, at boot and on '?'
    E,<seq>,<t0_us>,<d1>,...*HH                            edges: first absolute, then steps
    H,<seq>,<t_us>,<edges_total>,<overflow>,<level>*HH     heartbeat
    L,<seq>,<t_us>,<raw>*HH                                one conversion of the load cell, counts
    M,<seq>,<t_us>,<tag>*HH                                echo of the host's mark
    X,<seq>,<t_us>,<code>,<text>*HH                        error or event

``HH`` is the XOR of all characters before ``*``, as in NMEA 0183 (protocol 1). XOR misses two equal changes,
so that protocol 2, which our sketches speak, has a CRC-16/CCITT-FALSE there instead: four digits. Which of
the two holds is said by the banner, once for all lines that follow it.
"""

import binascii
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from functools import reduce
from operator import xor
from typing import NamedTuple

#: The longest line that a device may send: an X line with 60 characters of text and room to spare.
LINE_BYTES_MAX = 128
#: Steps in one E line; the device sends at most eight edges a line.
STEPS_MAX = 8
RAW_MIN, RAW_MAX = -(1 << 23), (1 << 23) - 1
_U16, _U32 = (1 << 16) - 1, (1 << 32) - 1


class Fault(Enum):
    """Why a line was thrown away."""

    CHECKSUM = "checksum"
    PARTIAL = "partial"
    MERGED = "merged"
    GARBAGE = "garbage"
    TOO_LONG = "too long"
    FORMAT = "format"


class Kind(Enum):
    """What a device says that it is."""

    TACHOMETER = "tach"
    LOAD_CELL = "load"


@dataclass(frozen=True, slots=True)
class Banner:
    """Who the device is.

    Attributes:
        protocol: 1 (XOR) or 2 (CRC-16).
        kind: tachometer or load cell.
        firmware: version of its sketch.
        uid: the unit, as written into its sketch.
        tick_us: resolution of its clock [us].
    """

    protocol: int
    kind: Kind
    firmware: str
    uid: str
    tick_us: int


@dataclass(frozen=True, slots=True)
class EdgeLine:
    """Edges: `ticks` [us, modulo 2**32], in order."""

    seq: int
    ticks: tuple[int, ...]

    @property
    def tick(self) -> int:
        """Time of the first edge [us, modulo 2**32]."""
        return self.ticks[0]


@dataclass(frozen=True, slots=True)
class HeartbeatLine:
    """Sent every 100 ms, also when nothing turns.

    Attributes:
        seq, tick: sequence number; time [us, modulo 2**32].
        total: edges (load cell: conversions) since boot that were or will be reported, modulo 2**32.
        overflow: edges that found the device's own buffer full and are lost.
        level: level of the sensor's input, 0 or 1.
    """

    seq: int
    tick: int
    total: int
    overflow: int
    level: int


@dataclass(frozen=True, slots=True)
class LoadLine:
    """One conversion of the load cell: `raw` [counts], signed 24 bits."""

    seq: int
    tick: int
    raw: int


@dataclass(frozen=True, slots=True)
class MarkLine:
    """Echo of the host's mark `tag`."""

    seq: int
    tick: int
    tag: str


@dataclass(frozen=True, slots=True)
class EventLine:
    """An error or event that the device reports itself."""

    seq: int
    tick: int
    code: int
    text: str


SequencedLine = EdgeLine | HeartbeatLine | LoadLine | MarkLine | EventLine
Line = Banner | SequencedLine


class BadLine(NamedTuple):
    """A line that was thrown away, for messages."""

    fault: Fault
    raw: bytes


def xor_checksum(text: bytes) -> int:
    """XOR of all bytes (NMEA 0183), 0..255."""
    return reduce(xor, text, 0)


def crc16(text: bytes) -> int:
    """CRC-16/CCITT-FALSE: polynomial 0x1021, start 0xFFFF, not reflected."""
    return binascii.crc_hqx(text, 0xFFFF)


def decode_line(raw: bytes, protocol: int) -> Line | Fault:
    """One line without its line end, checked by `protocol` (a banner: by its own); a fault when it is bad."""
    if not raw.isascii() or not all(0x20 <= byte < 0x7F for byte in raw):
        return Fault.GARBAGE
    body, star, digits = raw.rpartition(b"*")
    if not star:
        return Fault.PARTIAL if raw[:2] in _KINDS else Fault.GARBAGE
    if b"*" in body:
        return Fault.MERGED
    if raw[:2] not in _KINDS:
        return Fault.GARBAGE
    if raw[:2] == b"I,":
        protocol = 2 if raw.startswith(b"I,2,") else 1
    if not _checked(body, digits, protocol):
        return Fault.PARTIAL if len(digits) < 2 * protocol else Fault.CHECKSUM
    return _DECODERS[raw[:2]](body.decode("ascii").split(",")[1:]) or Fault.FORMAT


def _checked(body: bytes, digits: bytes, protocol: int) -> bool:
    if protocol == 2:
        return bool(_HEX4.fullmatch(digits)) and int(digits, 16) == crc16(body)
    return bool(_HEX2.fullmatch(digits)) and int(digits, 16) == xor_checksum(body)


class LineParser:
    """Collects bytes, gives lines. Keeps an unfinished line until its end arrives.

    Attributes:
        faults: lines thrown away, by reason.
        protocol: 1 until a banner says otherwise.
        last_bad: the youngest bad line, or None.
    """

    def __init__(self) -> None:
        self.faults: Counter[Fault] = Counter()
        self.protocol = 1
        self.last_bad: BadLine | None = None
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[Line]:
        """Take bytes as they came, in pieces of any size; the complete, correct lines among them."""
        *complete, self._rest = (self._rest + data).split(b"\n")
        lines = [line for raw in complete if (line := self._take(raw)) is not None]
        if len(self._rest) > LINE_BYTES_MAX:
            # The end of this line is not worth waiting for; what follows up to its end belongs to it.
            self._skipping, self._rest = True, self._rest[:LINE_BYTES_MAX] + b"\0"
        return lines

    def reset(self) -> None:
        """Forget the unfinished line (the connection was another one); the counts stay."""
        self._rest, self._skipping = b"", False

    def _take(self, raw: bytes) -> Line | None:
        raw = raw.removesuffix(b"\r")
        skipped, self._skipping = self._skipping, False
        if not raw:
            return None
        found = Fault.TOO_LONG if skipped or len(raw) > LINE_BYTES_MAX else decode_line(raw, self.protocol)
        if isinstance(found, Fault):
            self.faults[found] += 1
            self.last_bad = BadLine(found, raw)
            return None
        if isinstance(found, Banner):
            self.protocol = found.protocol
        return found


# Fields. A number has one spelling only: no sign but that of counts, no leading zero.

_HEX2 = re.compile(rb"[0-9A-Fa-f]{2}")
_HEX4 = re.compile(rb"[0-9A-Fa-f]{4}")
_NUMBER = re.compile(r"0|[1-9][0-9]{0,9}")
_SIGNED = re.compile(r"0|-?[1-9][0-9]{0,6}")
_WORD = re.compile(r"[A-Za-z0-9_.-]{1,24}")
_KIND_NAMES = {kind.value: kind for kind in Kind}


def _unsigned(text: str, low: int, high: int) -> int | None:
    if not _NUMBER.fullmatch(text):
        return None
    value = int(text)
    return value if low <= value <= high else None


def _head(fields: list[str]) -> tuple[int, int] | None:
    """Sequence number and time, the first two fields of all lines but the banner."""
    seq, tick = _unsigned(fields[0], 0, _U16), _unsigned(fields[1], 0, _U32)
    return None if seq is None or tick is None else (seq, tick)


def _banner(fields: list[str]) -> Banner | None:
    if len(fields) != 5:
        return None
    protocol, tick_us = _unsigned(fields[0], 1, 2), _unsigned(fields[4], 1, 1_000_000)
    kind = _KIND_NAMES.get(fields[1])
    words = _WORD.fullmatch(fields[2]) and _WORD.fullmatch(fields[3])
    if protocol is None or tick_us is None or kind is None or not words:
        return None
    return Banner(protocol, kind, fields[2], fields[3], tick_us)


def _edges(fields: list[str]) -> EdgeLine | None:
    if not 2 <= len(fields) <= 2 + STEPS_MAX or (head := _head(fields)) is None:
        return None
    ticks = [head[1]]
    for text in fields[2:]:
        step = _unsigned(text, 1, _U32)
        if step is None:
            return None
        ticks.append((ticks[-1] + step) & _U32)
    return EdgeLine(head[0], tuple(ticks))


def _heartbeat(fields: list[str]) -> HeartbeatLine | None:
    if len(fields) != 5 or (head := _head(fields)) is None:
        return None
    total, overflow = _unsigned(fields[2], 0, _U32), _unsigned(fields[3], 0, _U32)
    level = _unsigned(fields[4], 0, 1)
    if total is None or overflow is None or level is None:
        return None
    return HeartbeatLine(*head, total, overflow, level)


def _load(fields: list[str]) -> LoadLine | None:
    if len(fields) != 3 or (head := _head(fields)) is None or not _SIGNED.fullmatch(fields[2]):
        return None
    raw = int(fields[2])
    return LoadLine(*head, raw) if RAW_MIN <= raw <= RAW_MAX else None


def _mark(fields: list[str]) -> MarkLine | None:
    if len(fields) != 3 or (head := _head(fields)) is None or not _WORD.fullmatch(fields[2]):
        return None
    return MarkLine(*head, fields[2])


def _event(fields: list[str]) -> EventLine | None:
    if len(fields) < 4 or (head := _head(fields)) is None:
        return None
    code = _unsigned(fields[2], 0, _U16)
    return None if code is None else EventLine(*head, code, ",".join(fields[3:]))


_DECODERS: dict[bytes, Callable[[list[str]], Line | None]] = {
    b"I,": _banner,
    b"E,": _edges,
    b"H,": _heartbeat,
    b"L,": _load,
    b"M,": _mark,
    b"X,": _event,
}
_KINDS = frozenset(_DECODERS)
