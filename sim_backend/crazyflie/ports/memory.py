"""Port 4, memories (``crtp_mem.c``, ``mem.c``). Addresses are u32; ids are the order of registration.

channel 0, information::

    01                          -> 01 number of memories
    02 id                       -> 02 id type u32 size, 8 bytes of serial number

channel 1, read::

    id address length           -> id address status data           (status 0, or EIO 5 without data)

channel 2, write::

    id address data             -> id address status

An id that does not exist trips an assertion in the firmware, and so does a read of more than 24 bytes
that succeeds, because the reply does not fit a packet. A write without a complete address is answered
with EIO (the firmware hands the memory a wrong length).
"""

import struct
from collections.abc import Sequence
from enum import IntEnum

from sim_backend.crazyflie.crtp import PAYLOAD_MAX, Packet
from sim_backend.crazyflie.interfaces import EIO, FirmwareAssertion, Memory
from sim_backend.crazyflie.ports import Send

SERIAL = bytes(8)
ADDRESSED = 5  # bytes of id and address


class MemoryChannel(IntEnum):
    """Channels of port 4."""

    INFO = 0
    READ = 1
    WRITE = 2


class MemoryPort:
    """Answers port 4 from the firmware's memories."""

    def __init__(self, memories: Sequence[Memory], send: Send) -> None:
        """Answer through ``send``."""
        self._memories = memories
        self._send = send

    def handle(self, packet: Packet) -> None:
        """One packet of the client.

        Raises:
            FirmwareAssertion: unknown memory, or a reply that does not fit.
        """
        if packet.channel == MemoryChannel.INFO:
            self._info(packet)
        elif packet.channel == MemoryChannel.READ:
            self._read(packet)
        elif packet.channel == MemoryChannel.WRITE:
            self._write(packet)

    def _memory(self, ident: int) -> Memory:
        if ident >= len(self._memories):
            raise FirmwareAssertion(f"mem.c: memory id {ident} of {len(self._memories)}")
        return self._memories[ident]

    def _info(self, packet: Packet) -> None:
        command, ident = packet.padded(2)[:2]
        if command == 1:
            self._send(packet.reply(bytes([1, len(self._memories)])))
        elif command == 2:
            memory = self._memory(ident)
            self._send(packet.reply(struct.pack("<BBBI", 2, ident, memory.type_id, memory.size) + SERIAL))

    def _read(self, packet: Packet) -> None:
        ident, address, length = struct.unpack_from("<BIB", packet.padded(6))
        data = self._memory(ident).read(address, length)
        head = struct.pack("<BI", ident, address)
        if data is None:
            self._send(packet.reply(head + bytes([EIO])))
            return
        if len(head) + 1 + len(data) > PAYLOAD_MAX:
            raise FirmwareAssertion(f"crtp.c: memory read of {length} bytes does not fit a packet")
        self._send(packet.reply(head + b"\0" + data))

    def _write(self, packet: Packet) -> None:
        head, data = packet.padded(ADDRESSED)[:ADDRESSED], packet.payload[ADDRESSED:]
        ident, address = struct.unpack("<BI", head)
        memory = self._memory(ident)
        written = len(packet.payload) >= ADDRESSED and memory.write(address, data)
        self._send(packet.reply(head + bytes([0 if written else EIO])))
