"""Port 5, log (``log.c``). Up to 16 blocks with 128 variables together, 26 bytes of values in a block.

channel 0, table of contents::

    03                  -> 03 u16 count, u32 crc, 10 (blocks), 80 (variables)
    02 u16 id           -> 02 id, type, group \\0 name \\0          (unknown id: 02)

channel 1, control; every command is answered with ``command, block, errno``::

    06 block {type, u16 id}*    create and append; the low nibble of type is what the client wants to get
    07 block {type, u16 id}*    append
    03 block period             start, period in 10 ms; 0: one packet now
    08 block u16 period_ms      start, period in ms
    04 block                    stop
    02 block                    delete
    05                          delete all

    ENOENT 2 no such block or variable, E2BIG 7 block full, ENOEXEC 8 no such command,
    ENOMEM 12 no block or variable left, EEXIST 17 block exists

channel 2, data, drone to client::

    block, u24 drone time [ms], values

A failed append keeps what it had appended, and a failed create keeps its block, as in the firmware. An entry
with id 0xFFFF means raw memory at an address; the simulation has none, such an entry reads 0.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from functools import lru_cache

from sim_backend.crazyflie.crtp import PAYLOAD_MAX, Packet, Port
from sim_backend.crazyflie.interfaces import E2BIG, EEXIST, ENOENT, ENOEXEC, ENOMEM
from sim_backend.crazyflie.ports import Send
from sim_backend.crazyflie.tables import LogTable, Number
from sim_backend.crazyflie.toc import FORMATS, TYPE_MASK, LogType

MAX_BLOCKS = 16
MAX_VARIABLES = 128
MAX_BYTES = 26
RAW_MEMORY_ID = 0xFFFF
RAW_MEMORY_ENTRIES = 3  # type and id, then an address in the place of two more entries
TICKS_MASK = 0xFFFFFF

_LENGTHS = {int(type_): struct.calcsize(FORMATS[type_.name]) for type_ in LogType}
_FLOAT = struct.Struct("<f")
_INTEGER_LIMITS = (-(2**31), 2**31 - 1)


class LogChannel(IntEnum):
    """Channels of port 5."""

    TOC = 0
    CONTROL = 1
    DATA = 2


class Control(IntEnum):
    """Commands of channel 1."""

    DELETE = 2
    START = 3
    STOP = 4
    RESET = 5
    CREATE_V2 = 6
    APPEND_V2 = 7
    START_V2 = 8


Part = tuple[int | None, "Callable[[Number], bytes]"]
"""Id of a variable, and what makes its bytes."""


@dataclass(slots=True)
class LogBlock:
    """A block: pairs of variable id (None: reads 0) and wanted type, and when it is due."""

    variables: list[tuple[int | None, int]] = field(default_factory=list)
    period_ms: int = 0
    due_ms: int | None = None
    parts: "list[Part] | None" = None
    """Of the variables, made when a packet is; None: not yet."""

    def bytes_used(self) -> int:
        """Bytes of values in a packet."""
        return sum(_LENGTHS.get(type_, 0) for _, type_ in self.variables)


class LogPort:
    """Answers port 5 from a :class:`LogTable` and sends the blocks' packets when they are due."""

    def __init__(self, logs: LogTable, tick_ms: Callable[[], int], send: Send) -> None:
        """Time stamps and periods are those of ``tick_ms``; answer through ``send``."""
        self._logs = logs
        self._tick_ms = tick_ms
        self._send = send
        self.blocks: dict[int, LogBlock] = {}
        self._commands: dict[int, Callable[[int, Packet], int]] = {
            Control.DELETE: self._delete,
            Control.START: self._start,
            Control.STOP: self._stop,
            Control.RESET: self._reset,
            Control.CREATE_V2: self._create,
            Control.APPEND_V2: self._append,
            Control.START_V2: self._start_v2,
        }

    def handle(self, packet: Packet) -> None:
        """One packet of the client."""
        if packet.channel == LogChannel.TOC:
            self._toc(packet)
        elif packet.channel == LogChannel.CONTROL:
            command, block = packet.padded(2)[:2]
            handler = self._commands.get(command)
            error = ENOEXEC if handler is None else handler(block, packet)
            self._send(packet.reply(bytes([command, block, error])))

    def reset(self) -> None:
        """Stop and delete all blocks."""
        self.blocks.clear()

    @property
    def is_due(self) -> bool:
        """Whether a block has something to send at this tick."""
        now = self._tick_ms()
        return any(block.due_ms is not None and block.due_ms <= now for block in self.blocks.values())

    def poll(self) -> None:
        """Send what is due. A block that missed several periods sends once and keeps its phase."""
        now = self._tick_ms()
        for ident, block in self.blocks.items():
            if block.due_ms is None or block.due_ms > now:
                continue
            self._send(self._data(ident, block, now))
            if block.period_ms == 0:
                block.due_ms = None
            else:
                block.due_ms += block.period_ms * (1 + (now - block.due_ms) // block.period_ms)

    def _toc(self, packet: Packet) -> None:
        command, ident = struct.unpack_from("<BH", packet.padded(3))
        if command == 3:
            info = struct.pack("<BHIBB", 3, len(self._logs), self._logs.crc, MAX_BLOCKS, MAX_VARIABLES)
            self._send(packet.reply(info))
        elif command == 2:
            if ident >= len(self._logs):
                self._send(packet.reply(b"\x02"))
                return
            entry = self._logs.entries[ident]
            names = f"{entry.group}\0{entry.name}\0".encode("ascii")
            self._send(packet.reply(struct.pack("<BHB", 2, ident, entry.type) + names))

    def _create(self, ident: int, packet: Packet) -> int:
        if ident in self.blocks:
            return EEXIST
        if len(self.blocks) >= MAX_BLOCKS:
            return ENOMEM
        self.blocks[ident] = LogBlock()
        return self._append(ident, packet)

    def _append(self, ident: int, packet: Packet) -> int:
        block = self.blocks.get(ident)
        if block is None:
            return ENOENT
        block.parts = None
        entries = list(
            struct.iter_unpack("<BH", packet.payload[2 : 2 + max(0, len(packet.payload) - 2) // 3 * 3])
        )
        index = 0
        while index < len(entries):
            type_byte, variable = entries[index]
            wanted = type_byte & TYPE_MASK
            if block.bytes_used() + _LENGTHS.get(wanted, 0) > MAX_BYTES:
                return E2BIG
            if sum(len(other.variables) for other in self.blocks.values()) >= MAX_VARIABLES:
                return ENOMEM
            if variable == RAW_MEMORY_ID:
                block.variables.append((None, wanted))
                index += RAW_MEMORY_ENTRIES
                continue
            if variable >= len(self._logs):
                return ENOENT
            block.variables.append((variable, wanted))
            index += 1
        return 0

    def _delete(self, ident: int, _packet: Packet) -> int:
        return 0 if self.blocks.pop(ident, None) is not None else ENOENT

    def _start(self, ident: int, packet: Packet) -> int:
        return self._start_every(ident, packet.padded(3)[2] * 10)

    def _start_v2(self, ident: int, packet: Packet) -> int:
        (period_ms,) = struct.unpack_from("<H", packet.padded(4), 2)
        return self._start_every(ident, period_ms)

    def _start_every(self, ident: int, period_ms: int) -> int:
        block = self.blocks.get(ident)
        if block is None:
            return ENOENT
        block.period_ms = period_ms
        block.due_ms = self._tick_ms() + period_ms
        return 0

    def _stop(self, ident: int, _packet: Packet) -> int:
        block = self.blocks.get(ident)
        if block is None:
            return ENOENT
        block.due_ms = None
        return 0

    def _reset(self, _ident: int, _packet: Packet) -> int:
        self.reset()
        return 0

    def _data(self, ident: int, block: LogBlock, now: int) -> Packet:
        if block.parts is None:
            block.parts = [self._part(variable, wanted) for variable, wanted in block.variables]
        data = bytes([ident]) + (now & TICKS_MASK).to_bytes(3, "little")
        value = self._logs.value
        for variable, encode in block.parts:
            encoded = encode(0 if variable is None else value(variable))
            if len(data) + len(encoded) > PAYLOAD_MAX:
                break
            data += encoded
        return Packet(Port.LOG, LogChannel.DATA, data)

    def _part(self, variable: int | None, wanted: int) -> Part:
        return variable, encoder(
            LogType.U8 if variable is None else self._logs.entries[variable].type, wanted
        )


@lru_cache
def encoder(stored: LogType, wanted: int) -> Callable[[Number], bytes]:
    """What makes the bytes of a value that the firmware stores as ``stored`` and the client wants as type
    ``wanted``.

    As in ``logRunBlock``: integers pass through a signed 32-bit integer and are cut to the wanted length;
    a float that is wanted as an integer is truncated (saturating, NaN gives 0). An undefined type has no
    bytes.
    """
    length = _LENGTHS.get(wanted, 0)
    if stored == LogType.FLOAT:
        if wanted == LogType.FLOAT:
            return _float32
        if wanted == LogType.FP16:
            return lambda value: _half(_float32(value))
        return lambda value: (_truncated(_as_float32(value)) & 0xFFFFFFFF).to_bytes(4, "little")[:length]
    bits = 8 * _LENGTHS[stored]
    mask = (1 << bits) - 1
    # u32 passes through a signed int
    signed = stored in (LogType.I8, LogType.I16, LogType.I32, LogType.U32)

    def number(value: Number) -> int:
        integer = (int(value) if math.isfinite(value) else 0) & mask
        return integer - (1 << bits) if signed and integer >> (bits - 1) else integer

    if wanted == LogType.FLOAT:
        return lambda value: _float32(number(value))
    if wanted == LogType.FP16:
        return lambda value: _half(_float32(number(value)))
    return lambda value: (number(value) & 0xFFFFFFFF).to_bytes(4, "little")[:length]


def _float32(value: float) -> bytes:
    try:
        return _FLOAT.pack(value)
    except OverflowError:
        return _FLOAT.pack(math.copysign(math.inf, value))


def _as_float32(value: float) -> float:
    result: float = _FLOAT.unpack(_float32(value))[0]
    return result


def _truncated(value: float) -> int:
    if math.isnan(value):
        return 0
    low, high = _INTEGER_LIMITS
    return int(min(max(value, low), high))


def _half(single: bytes) -> bytes:
    """Half precision as ``single2half`` (``num.c``): halves round up in magnitude, below 2^-15 is zero."""
    bits = int.from_bytes(single, "little")
    sign, exponent = bits >> 31, bits >> 23 & 0xFF
    if exponent == 0xFF and bits & 0x7FFFFF:  # not a number
        return b"\x00\x7e"
    if exponent > 142:
        return (sign << 15 | 0x7C00).to_bytes(2, "little")
    if exponent < 112:
        return b"\0\0"
    half = sign << 15 | ((exponent - 112 << 10) + (bits >> 13 & 0x3FF) + (bits >> 12 & 1))
    return half.to_bytes(2, "little")
