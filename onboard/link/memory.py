"""Memories, CRTP port 4: chunk by chunk, each acknowledged, some under way at once.

Channel 1 read: ``id u8, address u32, length u8`` -> ``id, address, status u8, data``. Channel 2 write: ``id
u8, address u32, data`` -> ``id, address, status``. Status 0 is done, 5 (EIO) refused. Little endian.
"""

import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from cflib.crtp.crtpstack import CRTPPort

from onboard.link.deadline import GrowingDeadline
from onboard.link.errors import CommandRefused, LinkInputError, LinkTimeout, NoSuchVariable
from onboard.link.exchange import Exchange, Query
from onboard.timebase import Timebase

_READ, _WRITE = 1, 2
CHUNK = 24
_BATCH = 32
"""Chunks after which the answers are looked at: a refusal is then not asked for a whole transfer long."""
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
        self, exchange: Exchange, known: list[MemoryInfo], transfer_timeout_s: float, time: Timebase
    ) -> None:
        self._exchange = exchange
        self._known = known
        self._timeout = transfer_timeout_s
        self._time = time
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
            starts = range(0, len(data), CHUNK)
            heads = [_HEAD.pack(memory.ident, address + start) for start in starts]
            rests = [data[start : start + CHUNK] for start in starts]
            self._steps(_WRITE, heads, rests, deadline)

    def read(self, type_id: int, address: int, length: int) -> bytes:
        """``length`` bytes from ``address`` on.

        Raises:
            NoSuchVariable, LinkInputError, CommandRefused, LinkTimeout, LinkLost.
        """
        memory = self._checked(type_id, address, length)
        with self._transfer(f"read {length} bytes from memory 0x{type_id:02x}") as deadline:
            starts = range(0, length, CHUNK)
            heads = [_HEAD.pack(memory.ident, address + start) for start in starts]
            wanted = [bytes((min(CHUNK, length - start),)) for start in starts]
            chunks = self._steps(_READ, heads, wanted, deadline)
        for chunk, asked in zip(chunks, wanted, strict=True):
            if len(chunk) != asked[0]:
                raise CommandRefused(
                    f"memory 0x{type_id:02x} gave {len(chunk)} bytes where {asked[0]} were asked for"
                )
        return b"".join(chunks)

    def _steps(
        self, channel: int, heads: list[bytes], rests: list[bytes], deadline: GrowingDeadline
    ) -> list[bytes]:
        """One request a chunk, some under way at once; a refusal ends it after at most a batch."""
        action = "write to" if channel == _WRITE else "read from"
        questions = [
            Query(CRTPPort.MEM, channel, head + rest, len(head), len(head) + 1)
            for head, rest in zip(heads, rests, strict=True)
        ]
        chunks = []
        for start in range(0, len(questions), _BATCH):
            batch = questions[start : start + _BATCH]
            what = f"{action} memory at {_HEAD.unpack_from(batch[0].payload)[1]}"
            for answer in self._exchange.ask_all(batch, time=self._time, deadline=deadline, what=what):
                ident, address = _HEAD.unpack_from(answer)
                status, chunk = answer[_HEAD.size], answer[_HEAD.size + 1 :]
                if status != 0:
                    raise CommandRefused(
                        f"the drone refuses to {action} memory {ident} at address {address}: status {status}"
                    )
                chunks.append(chunk)
        return chunks

    def _checked(self, type_id: int, address: int, length: int) -> MemoryInfo:
        memory = self.find(type_id)
        if address < 0 or length < 0 or address + length > memory.size:
            raise LinkInputError(
                f"memory 0x{type_id:02x} has {memory.size} bytes; {length} bytes at {address} do not fit"
            )
        return memory

    @contextmanager
    def _transfer(self, what: str) -> Iterator[GrowingDeadline]:
        if not self._busy.acquire(timeout=self._timeout):
            raise LinkTimeout(f"another memory transfer was still running after {self._timeout:g} s: {what}")
        try:
            yield GrowingDeadline(self._time(), self._timeout)
        finally:
            self._busy.release()
