"""A serial line from a board to the computer: bytes at the pace of the baud rate, and their accidents."""

from collections import deque

import numpy as np

from sim_backend.bench.faults import BenchFaults

BITS_A_BYTE = 10
"""8N1."""
_JUNK = (0x00, 0xFF)


class Wire:
    """The transmitting side of a UART with everything up to the computer; call :meth:`take` often.

    Attributes:
        baud: bit/s.
        pending: bytes that are not through yet.
    """

    def __init__(self, baud: int, rng: np.random.Generator, faults: BenchFaults) -> None:
        self.baud = baud
        self.pending = 0
        self._rng = rng
        self._faults = faults
        self._queue: deque[bytes] = deque()
        self._credit_from = 0.0

    def send_line(self, text: bytes) -> None:
        """Transmit a line with its end, as the faults leave it."""
        self._put(self._spoil(text))

    def send_raw(self, data: bytes) -> None:
        """Transmit bytes as they are."""
        self._put(data)

    def drop(self) -> None:
        """Forget what is not through: the transmitter was reset."""
        self._queue.clear()
        self.pending = 0

    def take(self, time: float) -> bytes:
        """The bytes that have arrived at the computer by `time` (s) since the last call."""
        if not self._queue:
            self._credit_from = time
            return b""
        if self._faults.stall.covers(time):
            return b""
        count = int((time - self._credit_from) * self.baud / BITS_A_BYTE + 1e-9)
        parts: list[bytes] = []
        taken = 0
        while self._queue and taken < count:
            part = self._queue.popleft()
            if len(part) > count - taken:
                self._queue.appendleft(part[count - taken :])
                part = part[: count - taken]
            parts.append(part)
            taken += len(part)
        self._credit_from += taken * BITS_A_BYTE / self.baud
        self.pending -= taken
        return b"".join(parts)

    def _put(self, data: bytes) -> None:
        self._queue.append(data)
        self.pending += len(data)

    def _chance(self, probability: float) -> bool:
        return probability > 0.0 and float(self._rng.random()) < probability

    def _spoil(self, text: bytes) -> bytes:
        faults, rng = self._faults, self._rng
        data = bytearray(text)
        if self._chance(faults.cut_line):
            del data[int(rng.integers(1, len(data))) :]
        elif not self._chance(faults.merge_line):
            crlf = faults.line_ends == "crlf" or (faults.line_ends == "mix" and self._chance(0.5))
            data += b"\r\n" if crlf else b"\n"
        if self._chance(faults.garbage):
            at = int(rng.integers(0, len(data)))
            data[at:at] = bytes(_JUNK[i] for i in rng.integers(0, 2, int(rng.integers(1, 5))))
        if faults.flip > 0.0:
            for index in np.flatnonzero(rng.random(len(data)) < faults.flip):
                data[int(index)] ^= 1 << int(rng.integers(0, 8))
        return bytes(data)
