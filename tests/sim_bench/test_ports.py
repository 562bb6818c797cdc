"""Pseudo-terminals as a computer sees them, in simulated time."""

import os
import select
import termios
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import serial

from sim_backend.bench.faults import BenchFaults
from sim_backend.bench.ports import AskedPort, BoardPort, InstrumentPort
from sim_backend.bench.tachometer import TachometerBoard
from tests.patience import PATIENCE_S
from tests.sim_bench.benches import Stand

QUIET_S = 0.2
"""Real time after which the kernel has nothing more to carry over."""


class Plugged:
    """A tachometer's board on a port, and a clock."""

    def __init__(self, **faults: object) -> None:
        rng = np.random.default_rng(0)
        self.board = TachometerBoard(rng, BenchFaults(resonator=0.0, **faults))  # type: ignore[arg-type]
        self.port = InstrumentPort(BoardPort(self.board, rng))
        self.ticks = 0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 1000)):
            self.ticks += 1
            self.board.step(self.ticks / 1000)
            self.port.poll(self.ticks / 1000)

    def run_until(self, reached: Callable[[], bool]) -> None:
        """Live in steps of 10 ms until the kernel has carried the bytes over, however long that takes."""
        deadline = time.monotonic() + PATIENCE_S
        while not reached():
            assert time.monotonic() < deadline
            self.run(0.01)


def drain(descriptor: int) -> bytes:
    """All bytes that wait, or are on their way through the kernel."""
    data = b""
    while select.select([descriptor], [], [], QUIET_S)[0]:
        data += os.read(descriptor, 65536)
    return data


@pytest.fixture
def plugged() -> Iterator[Plugged]:
    made = Plugged()
    yield made
    made.port.unplug()


def test_what_was_sent_while_nobody_listened_is_lost(plugged: Plugged) -> None:
    plugged.run(1.0)
    descriptor = os.open(plugged.port.name, os.O_RDWR | os.O_NOCTTY)
    try:
        plugged.run(0.25)
        lines = drain(descriptor).splitlines()
        assert [text.split(b",")[1] for text in lines if text.startswith(b"H")] == [b"10", b"11"]
        os.write(descriptor, b"?")
        plugged.run_until(lambda: b"I,1,tach" in drain(descriptor))
    finally:
        os.close(descriptor)


def test_pyserial_opens_it_and_another_speed_reads_noise(plugged: Plugged) -> None:
    with serial.Serial(plugged.port.name, 115200, timeout=QUIET_S) as port:
        plugged.run(0.35)
        assert port.read(1000).count(b"H,") == 3
    with serial.Serial(plugged.port.name, 9600, timeout=QUIET_S) as port:
        plugged.run(1.0)
        noise = port.read(1000)
        assert len(noise) > 100
        assert b"H," not in noise
        assert sum(byte > 127 for byte in noise) > 30


def test_opening_resets_a_board_of_the_uno_class() -> None:
    plugged = Plugged(reset_at_open=1.5)
    plugged.board.receive(b"S", 0.0)
    plugged.run(0.5)
    descriptor = os.open(plugged.port.name, os.O_RDWR | os.O_NOCTTY)
    try:
        plugged.run(1.4)
        assert drain(descriptor) == b"", "silence of the bootloader"
        plugged.run(0.3)
        remains, _, rest = drain(descriptor).partition(b"\r\n")
        assert remains.startswith(b"\xff")
        assert rest.startswith(b"I,1,tach")
        assert b"\nH,0,100000," in rest
        assert not plugged.board.running
    finally:
        os.close(descriptor)
        plugged.port.unplug()


def test_unplugging_ends_reads_and_replugging_has_another_name(plugged: Plugged) -> None:
    old = plugged.port.name
    descriptor = os.open(old, os.O_RDWR | os.O_NOCTTY)
    plugged.port.unplug()
    plugged.run(0.2)
    try:
        assert os.read(descriptor, 100) == b""
        with pytest.raises(OSError, match="Input/output"):
            os.write(descriptor, b"?")
    finally:
        os.close(descriptor)
    new = plugged.port.replug()
    assert new != old
    assert plugged.port.replug() not in (new, old) or plugged.port.name != new
    descriptor = os.open(plugged.port.name, os.O_RDWR | os.O_NOCTTY)
    try:
        plugged.run(0.2)
        assert b"H," in drain(descriptor)
    finally:
        os.close(descriptor)


def test_a_computer_that_does_not_read_loses_and_blocks_nothing(plugged: Plugged) -> None:
    descriptor = os.open(plugged.port.name, os.O_RDWR | os.O_NOCTTY)
    try:
        plugged.run(0.1)
        for _ in range(3000):
            plugged.board.emit("M", 1, "filler-filler")
        plugged.run(10.0)
        assert len(drain(descriptor)) < 70_000
    finally:
        os.close(descriptor)


def test_port_does_not_echo(plugged: Plugged) -> None:
    descriptor = os.open(plugged.port.name, os.O_RDWR | os.O_NOCTTY)
    try:
        assert not termios.tcgetattr(descriptor)[3] & (termios.ECHO | termios.ICANON)
        plugged.run(0.02)
        drain(descriptor)
        os.write(descriptor, b"S")
        plugged.run_until(lambda: plugged.board.running)
        assert b"S" not in drain(descriptor)
    finally:
        os.close(descriptor)


def test_supply_answers_after_a_thought() -> None:
    port = InstrumentPort(AskedPort(Stand().bench.scpi))
    try:
        with serial.Serial(port.name, 9600, timeout=QUIET_S) as line:
            line.write(b"*IDN?\n")
            for _ in range(3):
                port.poll(1.0)
                assert line.read(100) == b""
            port.poll(1.03)
            assert line.read(100).endswith(b"\n")
    finally:
        port.unplug()
