"""Memories of port 4 that every Crazyflie 2.1 has, and the plain RAM behind several of them."""

from collections.abc import Callable
from enum import IntEnum

TESTER_SIZE = 0x1000
TRAJECTORY_SIZE = 4096
EEPROM_SIZE = 0x1FFF
DECK_INFO_VERSION = 3
DECK_SECTION_SIZE = 0x10000000
DECK_MAX_COUNT = 4


class MemoryType(IntEnum):
    """Memory types (``mem.h``)."""

    EEPROM = 0x00
    ONE_WIRE = 0x01
    TRAJECTORY = 0x12
    TESTER = 0x15
    APP = 0x18
    DECK_MEMORY = 0x19


class RamMemory:
    """Bytes in RAM: reads and writes inside ``size`` succeed, all others are refused.

    Attributes:
        type_id: memory type as the client is told.
        data: the content.
    """

    def __init__(self, type_id: int, size: int, may_write: Callable[[], bool] = lambda: True) -> None:
        """Zeroed memory; writes are refused while ``may_write`` says no."""
        self.type_id = type_id
        self.data = bytearray(size)
        self._may_write = may_write

    @property
    def size(self) -> int:
        """Size in bytes."""
        return len(self.data)

    def read(self, address: int, length: int) -> bytes | None:
        """``length`` bytes from ``address``; ``None`` outside the memory."""
        if address + length > len(self.data):
            return None
        return bytes(self.data[address : address + length])

    def write(self, address: int, data: bytes) -> bool:
        """Write ``data``; False outside the memory or while writing is not allowed."""
        if address + len(data) > len(self.data) or not self._may_write():
            return False
        self.data[address : address + len(data)] = data
        return True

    def clear(self) -> None:
        """Lose the content, as at a reset."""
        self.data[:] = bytes(len(self.data))


class MemoryTester:
    """The firmware's memory tester (``mem.c``): a read at address a gives a & 255, a write must hold the
    same.

    Attributes:
        write_errors: packets with wrong content (the log ``memTst.errCntW``). Set to zero through
            :meth:`reset_write_errors` (the parameter ``memTst.resetW``).
    """

    type_id = int(MemoryType.TESTER)
    size = TESTER_SIZE

    def __init__(self) -> None:
        """No errors so far."""
        self.write_errors = 0

    def read(self, address: int, length: int) -> bytes:
        """The pattern; never refused, also beyond ``size``."""
        return bytes((address + i) & 0xFF for i in range(length))

    def write(self, address: int, data: bytes) -> bool:
        """Compare with the pattern; never refused."""
        if data != self.read(address, len(data)):
            self.write_errors += 1
        return True

    def reset_write_errors(self) -> None:
        """Start counting from zero."""
        self.write_errors = 0


class DeckMemory:
    """The decks' memory of a drone without decks: empty information, writes to it do nothing."""

    type_id = int(MemoryType.DECK_MEMORY)
    size = DECK_SECTION_SIZE * (DECK_MAX_COUNT + 1) & 0xFFFFFFFF

    def read(self, address: int, length: int) -> bytes | None:
        """Version byte at address 0, zeros in the rest of the first section, nothing beyond."""
        if address >= DECK_SECTION_SIZE:
            return None
        return bytes(DECK_INFO_VERSION if address + i == 0 else 0 for i in range(length))

    def write(self, address: int, _data: bytes) -> bool:
        """Commands to decks that are not there: accepted in the first section, refused beyond."""
        return address < DECK_SECTION_SIZE
