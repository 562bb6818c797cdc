"""The app's memory (port 4, type 0x18): the staged bundle, and the recorder behind it, to be read only."""

from collections.abc import Callable

from onboard.app_interface import BUNDLE_ADDRESS, MEMORY_SIZE, MEMORY_TYPE_APP, RECORD_ADDRESS
from onboard.ring import RING_BYTES
from sim_backend.crazyflie.memory import RamMemory


class AppMemory:
    """Two regions with a gap between them; what is not all in one is refused.

    Args:
        may_write: whether the staged bundle may be written now.
        record: the recorder's bytes.
    """

    type_id = MEMORY_TYPE_APP
    size = RECORD_ADDRESS + RING_BYTES

    def __init__(self, may_write: Callable[[], bool], record: Callable[[], bytes]) -> None:
        self._staged = RamMemory(MEMORY_TYPE_APP, MEMORY_SIZE, may_write)
        self._record = record

    def staged(self, length: int) -> bytes:
        """The first bytes of the staged bundle."""
        return bytes(self._staged.data[BUNDLE_ADDRESS : BUNDLE_ADDRESS + length])

    def read(self, address: int, length: int) -> bytes | None:
        """``length`` bytes from ``address``; ``None`` where they are not all in one region."""
        if address < RECORD_ADDRESS:
            return self._staged.read(address, length)
        offset = address - RECORD_ADDRESS
        return self._record()[offset : offset + length] if offset + length <= RING_BYTES else None

    def write(self, address: int, data: bytes) -> bool:
        """Write to the staged bundle; False elsewhere, and while writing is not allowed."""
        return self._staged.write(address, data)

    def clear(self) -> None:
        """Lose the staged bundle, as at a reset."""
        self._staged.clear()
