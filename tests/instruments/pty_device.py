"""A device on a pseudo-terminal, in a thread: answers what it is asked, and says what the test wants."""

import os
import select
import threading
import tty
from collections.abc import Callable, Iterable
from functools import reduce
from operator import xor
from typing import Self

from tests.patience import patient_port


def framed(body: str) -> bytes:
    """A line of protocol 1, without its end. Written out again here, not taken from the code under test."""
    return f"{body}*{reduce(xor, body.encode()):02X}".encode()


def _crc_step(byte: int) -> int:
    """What one byte does to an empty CRC-16/CCITT register, bit by bit."""
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


_CRC_STEPS = [_crc_step(byte) for byte in range(256)]


def crc_framed(body: str) -> bytes:
    """A line of protocol 2."""
    crc = 0xFFFF
    for byte in body.encode():
        crc = (crc << 8 & 0xFFFF) ^ _CRC_STEPS[crc >> 8 ^ byte]
    return f"{body}*{crc:04X}".encode()


class PtyDevice:
    """The device's end of a serial cable.

    Attributes:
        name: what a program opens.
        patient: the same, as an address whose answers may take as long as the machine is busy.
        received: everything that the program sent.
    """

    def __init__(self, answer: Callable[[bytes], bytes] = lambda _data: b"") -> None:
        self._answer = answer
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.name = os.ttyname(self._slave)
        self.patient = patient_port(self.name)
        self.received = b""
        self._changed = threading.Condition()
        self._wake_read, self._wake_write = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def send(self, *lines: bytes, end: bytes = b"\n") -> None:
        """Send lines."""
        os.write(self._master, b"".join(line + end for line in lines))

    def send_raw(self, data: bytes) -> None:
        """Send bytes as they are."""
        os.write(self._master, data)

    def await_received(self, data: bytes, within_s: float = 120.0) -> None:
        """Wait until the program has sent `data`."""
        with self._changed:
            assert self._changed.wait_for(lambda: data in self.received, within_s), (data, self.received)

    def unplug(self) -> None:
        """Pull the cable; idempotent."""
        os.write(self._wake_write, b"x")
        self._thread.join()
        if self._master >= 0:
            os.close(self._slave)
            os.close(self._master)
            self._master = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _run(self) -> None:
        while True:
            ready, _, _ = select.select([self._master, self._wake_read], [], [])
            if self._wake_read in ready:
                return
            data = os.read(self._master, 4096)
            answer = self._answer(data)
            if answer:
                os.write(self._master, answer)
            with self._changed:
                self.received += data
                self._changed.notify_all()


class LineBoard(PtyDevice):
    """A tachometer or load cell of protocol 1 that says what the test tells it to, with its own numbers."""

    def __init__(self, kind: str = "tach", uid: str = "t1", silent_for: int = 0) -> None:
        self.seq = 0
        self.ticks = 1_000_000
        self.total = 0
        self._kind, self._uid = kind, uid
        self._ignore = silent_for
        super().__init__(self._reply)

    def banner(self) -> bytes:
        return framed(f"I,1,{self._kind},1.0,{self._uid},4")

    def line(self, kind: str, *fields: object, ticks: int | None = None) -> bytes:
        """The next numbered line."""
        tick = (self.ticks if ticks is None else ticks) % (1 << 32)
        text = ",".join([kind, str(self.seq), str(tick), *map(str, fields)])
        self.seq = (self.seq + 1) % (1 << 16)
        return framed(text)

    def beat(self) -> bytes:
        self.ticks += 100_000
        return self.line("H", self.total, 0, 1)

    def edges(self, steps: Iterable[int]) -> bytes:
        """Edges after the present time; the time moves on to the last one."""
        steps = list(steps)
        first = self.ticks + steps[0]
        self.ticks += sum(steps)
        self.total += len(steps)
        return self.line("E", *steps[1:], ticks=first)

    def restart(self) -> bytes:
        """Boot: the banner; numbers and clock begin anew."""
        self.seq = self.total = 0
        self.ticks = 5_000
        return self.banner()

    def _reply(self, data: bytes) -> bytes:
        if self._ignore > 0:
            self._ignore -= 1
            return b""
        answer = b""
        for command in data.split(b"\n"):
            if command == b"?":
                answer += self.banner() + b"\r\n"
            elif command.startswith(b"M"):
                self.ticks += 1_000
                answer += self.line("M", command[1:].decode()) + b"\n"
        return answer
