"""Port 2, parameters (``param_task.c``, ``param_logic.c``). Values are little endian, ids u16.

channel 0, table of contents::

    03                  -> 03 u16 count, u32 crc
    02 id               -> 02 id, type byte, group \\0 name \\0      (unknown id: 02)

channel 1, read::

    id                  -> id 00 value                              (unknown id: id 02)

channel 2, write::

    id value            -> the packet as it came                    (unknown id: id 02; read-only: nothing)

channel 3, the rest::

    00 group\\0 name\\0 type value   -> 00 group\\0 name\\0 errno   (ENOENT 2, EACCES 13, EINVAL 22)
    01 id value         drone to client: the firmware changed a parameter itself
    02 id               -> 02 id extended type                      (none: 02 id 02), deprecated
    03 id               -> 03 id 00                                 store; not persistent: 03 id 02
    04 id               -> 04 id 00 default | 04 id 01 default stored | 04 id 02
    05 id               -> 05 id 00                                 clear; nothing stored: 05 id 02
    06 id               -> 06 id default                            (none: 06 id 02), deprecated
    07 id               -> 07 id 00 extended type                   (none: 07 id 02)
    08 id               -> 08 id 00 default                         (read-only or unknown: 08 id 02)

The firmware's parameter task takes one packet after the other. A write is answered before its callback runs
(a set by name after that), and while the task is in a callback, packets queue. Bytes that are missing in a
packet read as zero here; the firmware reads what its buffer held before.
"""

import struct
from collections import deque
from enum import IntEnum

from sim_backend.crazyflie.crtp import PAYLOAD_MAX, Packet, Port
from sim_backend.crazyflie.interfaces import EACCES, EINVAL, ENOENT
from sim_backend.crazyflie.ports import Send
from sim_backend.crazyflie.tables import ParameterTable, TableParameter
from sim_backend.crazyflie.toc import CORE, EXTENDED, READ_ONLY

PERSISTENT_NOT_STORED, PERSISTENT_STORED, NOT_FOUND = 0, 1, 2


class ParamChannel(IntEnum):
    """Channels of port 2."""

    TOC = 0
    READ = 1
    WRITE = 2
    MISC = 3


class Misc(IntEnum):
    """Commands of channel 3."""

    SET_BY_NAME = 0
    VALUE_UPDATED = 1
    EXTENDED_TYPE = 2
    STORE = 3
    STATE = 4
    CLEAR = 5
    DEFAULT = 6
    EXTENDED_TYPE_V2 = 7
    DEFAULT_V2 = 8


class ParamPort:
    """Answers port 2 from a :class:`ParameterTable`."""

    def __init__(self, params: ParameterTable, send: Send) -> None:
        """Answer through ``send``."""
        self._params = params
        self._send = send
        self._queue: deque[Packet] = deque()
        self._answer: Packet | None = None
        self._channels = {
            ParamChannel.TOC: self._toc,
            ParamChannel.READ: self._read,
            ParamChannel.WRITE: self._write,
            ParamChannel.MISC: self._misc,
        }
        self._replies = {
            Misc.EXTENDED_TYPE: self._extended_type,
            Misc.STORE: self._store,
            Misc.STATE: self._state,
            Misc.CLEAR: self._clear,
            Misc.DEFAULT: self._default,
            Misc.EXTENDED_TYPE_V2: self._extended_type_v2,
            Misc.DEFAULT_V2: self._default_v2,
        }

    def handle(self, packet: Packet) -> None:
        """One packet of the client."""
        self._queue.append(packet)
        self._work()

    def poll(self) -> None:
        """Go on after a step of the firmware, then tell the client what the firmware changed itself."""
        self._work()
        for ident in self._params.take_updates():
            payload = struct.pack("<BH", Misc.VALUE_UPDATED, ident) + self._params.raw(ident)
            self._send(Packet(Port.PARAM, ParamChannel.MISC, payload))

    def _work(self) -> None:
        """The parameter task, until it is in a callback or has nothing left to do."""
        while not self._params.busy:
            if self._answer is not None:
                self._send(self._answer)
                self._answer = None
            if not self._queue:
                return
            packet = self._queue.popleft()
            self._channels[ParamChannel(packet.channel)](packet)

    def _entry(self, ident: int) -> TableParameter | None:
        return self._params.entries[ident] if ident < len(self._params) else None

    def _toc(self, packet: Packet) -> None:
        command, ident = struct.unpack_from("<BH", packet.padded(3))
        if command == 3:
            self._send(packet.reply(struct.pack("<BHI", 3, len(self._params), self._params.crc)))
        elif command == 2:
            entry = self._entry(ident)
            if entry is None:
                self._send(packet.reply(b"\x02"))
                return
            names = f"{entry.group}\0{entry.name}\0".encode("ascii")
            self._send(packet.reply(struct.pack("<BHB", 2, ident, entry.type_byte) + names))

    def _read(self, packet: Packet) -> None:
        (ident,) = struct.unpack_from("<H", packet.padded(2))
        if self._entry(ident) is None:
            self._send(packet.reply(struct.pack("<HB", ident, ENOENT)))
        else:
            self._send(packet.reply(struct.pack("<HB", ident, 0) + self._params.raw(ident)))

    def _write(self, packet: Packet) -> None:
        (ident,) = struct.unpack_from("<H", packet.padded(2))
        entry = self._entry(ident)
        if entry is None:
            self._send(packet.reply(struct.pack("<HB", ident, NOT_FOUND)))
        elif not entry.read_only:
            self._params.write_raw(ident, packet.payload[2:])
            self._send(packet)
            self._params.notify(ident)

    def _misc(self, packet: Packet) -> None:
        command, ident = struct.unpack_from("<BH", packet.padded(3))
        if command == Misc.SET_BY_NAME:
            self._set_by_name(packet)
        elif command in self._replies:
            answer = self._replies[Misc(command)](ident, self._entry(ident))
            self._send(packet.reply(struct.pack("<BH", command, ident) + answer))

    def _set_by_name(self, packet: Packet) -> None:
        """Set by name; here the callback runs before the answer, as in the firmware."""
        parts = packet.padded(PAYLOAD_MAX)[1:].split(b"\0", 2)
        if len(parts) < 3:
            return
        group, name, rest = parts
        full_name = b".".join((group, name)).decode("ascii", "replace")
        error = self._write_by_name(full_name, rest[0] if rest else 0, rest[1:])
        answer = bytes([Misc.SET_BY_NAME]) + group + b"\0" + name + b"\0" + bytes([error])
        self._answer = packet.reply(answer)

    def _write_by_name(self, full_name: str, type_byte: int, value: bytes) -> int:
        if full_name not in self._params:
            return ENOENT
        entry = self._params.entry(full_name)
        if type_byte != entry.type_byte & ~(CORE | READ_ONLY | EXTENDED):
            return EINVAL
        if entry.read_only:
            return EACCES
        self._params.write_raw(entry.ident, value)
        self._params.notify(entry.ident)
        return 0

    def _extended_type(self, _ident: int, entry: TableParameter | None) -> bytes:
        return bytes([entry.extended_type if entry and entry.extended else NOT_FOUND])

    def _extended_type_v2(self, _ident: int, entry: TableParameter | None) -> bytes:
        return bytes([0, entry.extended_type]) if entry and entry.extended else bytes([ENOENT])

    def _store(self, ident: int, entry: TableParameter | None) -> bytes:
        return bytes([0 if entry and self._params.store(ident) else ENOENT])

    def _clear(self, ident: int, entry: TableParameter | None) -> bytes:
        return bytes([0 if entry and self._params.clear(ident) else ENOENT])

    def _state(self, ident: int, entry: TableParameter | None) -> bytes:
        if entry is None:
            return bytes([NOT_FOUND])
        stored = self._params.stored(ident)
        if stored is None:
            return bytes([PERSISTENT_NOT_STORED]) + self._params.default_raw(ident)
        return bytes([PERSISTENT_STORED]) + self._params.default_raw(ident) + stored

    def _default(self, ident: int, entry: TableParameter | None) -> bytes:
        return bytes([NOT_FOUND]) if entry is None or entry.read_only else self._params.default_raw(ident)

    def _default_v2(self, ident: int, entry: TableParameter | None) -> bytes:
        if entry is None or entry.read_only:
            return bytes([ENOENT])
        return b"\0" + self._params.default_raw(ident)
