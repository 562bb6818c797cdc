"""Memories, CRTP port 4: chunk by chunk, each acknowledged.

Channel 1 read: ``id u8, address u32, length u8`` -> ``id, address, status u8, data``. Channel 2 write: ``id
u8, address u32, data`` -> ``id, address, status``. Status 0 is done, 5 (EIO) refused. Little endian.
"""

import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from cflib.crtp.crtpstack import CRTPPort

from onboard.clock import Clock
from onboard.link.errors import CommandRefused, LinkInputError, LinkTimeout, NoSuchVariable
from onboard.link.exchange import Exchange

_READ, _WRITE = 1, 2
CHUNK = 24
_HEAD = struct.Struct("<BI")


@dataclass(frozen=True, slots=True)
class MemoryInfo:
    """One memory that the drone advertises. Ids are its order of registration, so look it up by type."""

    ident: int
    type_id: int
    size: int


class Memories:
    """Reads and writes the drone's memories, one transfer at a time."""

    def __init__(
        self, exchange: Exchange, known: list[MemoryInfo], transfer_timeout_s: float, clock: Clock
    ) -> None:
        self._exchange = exchange
        self._known = known
        self._timeout = transfer_timeout_s
        self._clock = clock
        self._busy = threading.Lock()

    def find(self, type_id: int) -> MemoryInfo:
        """The first memory of this type.

        Raises:
            NoSuchVariable: the drone has none.
        """
        for memory in self._known:
            if memory.type_id == type_id:
                return memory
        types = ", ".join(f"0x{memory.type_id:02x}" for memory in self._known)
        raise NoSuchVariable(
            f"the drone has no memory of type 0x{type_id:02x} (it has {types}); wrong firmware?"
        )

    def write(self, type_id: int, data: bytes, address: int) -> None:
        """Write ``data`` from ``address`` on; every chunk is acknowledged.

        Raises:
            NoSuchVariable, LinkInputError, CommandRefused, LinkTimeout, LinkLost.
        """
        memory = self._checked(type_id, address, len(data))
        with self._transfer(f"write {len(data)} bytes to memory 0x{type_id:02x}") as deadline:
            for offset in range(0, len(data), CHUNK):
                head = _HEAD.pack(memory.ident, address + offset)
                self._step(_WRITE, head, data[offset : offset + CHUNK], deadline)

    def read(self, type_id: int, address: int, length: int) -> bytes:
        """``length`` bytes from ``address`` on.

        Raises:
            NoSuchVariable, LinkInputError, CommandRefused, LinkTimeout, LinkLost.
        """
        memory = self._checked(type_id, address, length)
        data = bytearray()
        with self._transfer(f"read {length} bytes from memory 0x{type_id:02x}") as deadline:
            while len(data) < length:
                wanted = min(CHUNK, length - len(data))
                head = _HEAD.pack(memory.ident, address + len(data))
                chunk = self._step(_READ, head, bytes((wanted,)), deadline)
                if len(chunk) != wanted:
                    raise CommandRefused(
                        f"memory 0x{type_id:02x} gave {len(chunk)} bytes where {wanted} were asked for"
                    )
                data += chunk
        return bytes(data)

    def _step(self, channel: int, head: bytes, rest: bytes, deadline: float) -> bytes:
        ident, address = _HEAD.unpack(head)
        reply, _ = self._exchange.ask(
            CRTPPort.MEM,
            channel,
            head + rest,
            accepts=lambda data: data[: len(head)] == head and len(data) > len(head),
            within=max(0.0, deadline - self._clock()),
            what=f"{'write' if channel == _WRITE else 'read'} memory {ident} at {address}",
        )
        status = reply[len(head)]
        if status != 0:
            action = "write to" if channel == _WRITE else "read from"
            raise CommandRefused(
                f"the drone refuses to {action} memory {ident} at address {address}: status {status}"
            )
        return reply[len(head) + 1 :]

    def _checked(self, type_id: int, address: int, length: int) -> MemoryInfo:
        memory = self.find(type_id)
        if address < 0 or length < 0 or address + length > memory.size:
            raise LinkInputError(
                f"memory 0x{type_id:02x} has {memory.size} bytes; {length} bytes at {address} do not fit"
            )
        return memory

    @contextmanager
    def _transfer(self, what: str) -> Iterator[float]:
        deadline = self._clock() + self._timeout
        if not self._busy.acquire(timeout=self._timeout):
            raise LinkTimeout(f"another memory transfer was still running after {self._timeout:g} s: {what}")
        try:
            yield deadline
        finally:
            self._busy.release()
