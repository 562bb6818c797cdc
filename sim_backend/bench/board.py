"""A microcontroller on a serial line: its clock, its starts, its commands and its numbered lines."""

from abc import ABC, abstractmethod

import numpy as np

from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.line_protocol import (
    HEARTBEAT_S,
    MICROS_RANGE,
    SEQUENCE_RANGE,
    TICK_US,
    line,
)
from sim_backend.bench.wire import Wire

BAUD = 115200
FIRMWARE = "sim1"
RESONATOR = 0.005
"""Largest relative error of a ceramic resonator."""
TAG_MAX = 16
ROUNDING_S = 1e-9
"""Sums of periods are this exact at least."""
BOOTLOADER = b"\xff\x00\xf0,17,0,1*5C\r\n"
"""What a bootloader and the line that was cut by the reset leave on the wire."""
RESET_SILENCE_S = 0.5
"""What a board that resets by itself needs to come back, s."""


class Board(ABC):
    """What tachometer and load cell have in common; call :meth:`step` once a ms of bench time.

    Attributes:
        kind: ``tach`` or ``load``.
        wire: its line to the computer.
        clock_error: relative error of its clock.
        running: whether the host has started it.
        total: edges or conversions that were or will be reported since its start.
        overflow: edges that it had no room for since its start.
        level: of its input, 0 or 1.
        starts: how often it has started.
    """

    def __init__(self, kind: str, rng: np.random.Generator, faults: BenchFaults) -> None:
        self.kind = kind
        self.wire = Wire(BAUD, rng, faults)
        self.faults = faults
        self.rng = rng
        drawn = float(rng.uniform(-RESONATOR, RESONATOR))
        self.clock_error = drawn if faults.resonator is None else faults.resonator
        self._uid = f"{int(rng.integers(0, 1 << 32)):08x}"
        self._resets = sorted(faults.reset_at)
        self.starts = 0
        self._restart_at: float | None = None
        self._tag: str | None = None
        self._sequence = 0
        self._clear()
        self._start(0.0)

    # What a kind of board adds.

    @abstractmethod
    def work(self, time: float) -> None:
        """One ms of its own work at bench time `time` (s)."""

    @abstractmethod
    def forget(self) -> None:
        """Its memory after a start."""

    # The computer's side.

    def opened(self, time: float) -> None:
        """The computer has opened the port at `time` (s)."""
        if self.faults.reset_at_open is not None:
            self._reset(time, self.faults.reset_at_open)

    def receive(self, data: bytes, time: float) -> None:
        """Bytes from the computer at `time` (s)."""
        if self._restart_at is not None:
            return
        for byte in data:
            self._receive_byte(byte, time)

    def step(self, time: float) -> None:
        """One ms of life that ends at `time` (s)."""
        if self._resets and time >= self._resets[0]:
            self._resets.pop(0)
            self._reset(time, RESET_SILENCE_S)
        if self._restart_at is not None:
            if time < self._restart_at:
                return
            self._restart_at = None
            self.wire.send_raw(BOOTLOADER)
            self._start(time)
        self.work(time)
        if time >= self._heartbeat_due - ROUNDING_S:
            self._heartbeat_due += HEARTBEAT_S
            self.emit("H", self.micros(time), self.total % MICROS_RANGE, self.overflow, self.level)

    def micros(self, time: float) -> int:
        """The board's clock at bench time `time` (s): microseconds in steps of 4, 32 bits."""
        elapsed = (time - self._started) * 1e6 * (1.0 + self.clock_error)
        return (self._first_micros + int(elapsed) // TICK_US * TICK_US) % MICROS_RANGE

    def emit(self, letter: str, *fields: str | int) -> None:
        """Send a numbered line."""
        self.wire.send_line(line(self.faults.protocol, letter, self._sequence, *fields))
        self._sequence = (self._sequence + 1) % SEQUENCE_RANGE

    def _receive_byte(self, byte: int, time: float) -> None:
        if self._tag is not None:
            if byte in b"\r\n":
                self.emit("M", self.micros(time), self._tag)
                self._tag = None
            elif 0x20 < byte < 0x7F and byte not in b",*" and len(self._tag) < TAG_MAX:
                self._tag += chr(byte)
        elif byte == ord("?"):
            self._identify()
        elif byte in b"SP":
            self.running = byte == ord("S")
        elif byte == ord("M"):
            self._tag = ""

    def _identify(self) -> None:
        protocol = self.faults.protocol
        self.wire.send_line(line(protocol, "I", protocol, self.kind, FIRMWARE, self._uid, TICK_US))

    def _clear(self) -> None:
        self.running = False
        self._sequence = 0
        self._tag = None
        self.total = self.overflow = 0
        self.level = 1

    def _reset(self, time: float, silence: float) -> None:
        self.wire.drop()
        self._clear()
        self._restart_at = time + silence

    def _start(self, time: float) -> None:
        self.starts += 1
        self._started = time
        wrap_in = self.faults.wrap_in
        ticks = 0 if wrap_in is None else (MICROS_RANGE - int(wrap_in * 1e6)) // TICK_US
        self._first_micros = ticks * TICK_US
        self._heartbeat_due = time + HEARTBEAT_S
        self.forget()
        self._identify()
