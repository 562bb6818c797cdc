"""The instruments' ports: boards and supply behind pseudo-terminals that can be pulled out and put in."""

from typing import Protocol

import numpy as np

from sim_backend.bench.board import Board
from sim_backend.bench.terminal import Terminal

ANSWER_S = 0.02
"""They think before they answer."""


class Electronics(Protocol):
    """What is behind a port."""

    def opened(self, time: float) -> None:
        """The computer opened the port."""
        ...

    def receive(self, data: bytes, time: float) -> None:
        """The computer sent bytes."""
        ...

    def take(self, time: float, speed: int) -> bytes:
        """Bytes for a computer that listens at `speed` baud."""
        ...


class BoardPort:
    """A board as a port shows it: the computer reads noise when its baud rate is another."""

    def __init__(self, board: Board, rng: np.random.Generator) -> None:
        self._board = board
        self._rng = rng

    def opened(self, time: float) -> None:
        """Opening may reset the board."""
        self._board.opened(time)

    def receive(self, data: bytes, time: float) -> None:
        """Commands."""
        self._board.receive(data, time)

    def take(self, time: float, speed: int) -> bytes:
        """What has arrived."""
        data = self._board.wire.take(time)
        return data if speed == self._board.wire.baud else self._rng.bytes(len(data))


class Asked(Protocol):
    """What speaks only when asked."""

    def receive(self, data: bytes) -> bytes:
        """Take what the computer sent; the answer."""


class AskedPort:
    """A supply or balance as its port shows it; a USB port, which has no baud rate."""

    def __init__(self, asked: Asked) -> None:
        self._asked = asked
        self._answer = b""
        self._at = 0.0

    def opened(self, time: float) -> None:
        """Nothing happens."""

    def receive(self, data: bytes, time: float) -> None:
        """Commands."""
        answer = self._asked.receive(data)
        if answer:
            self._answer += answer
            self._at = time + ANSWER_S

    def take(self, time: float, speed: int) -> bytes:
        """The answer, when it is ready."""
        if not self._answer or time < self._at:
            return b""
        data, self._answer = self._answer, b""
        return data


class InstrumentPort:
    """One instrument's port.

    Attributes:
        name: its device; the last one while it is unplugged.
    """

    def __init__(self, electronics: Electronics) -> None:
        self._electronics = electronics
        self._terminal: Terminal | None = Terminal()
        self.name = self._terminal.name
        self._was_open = False

    def poll(self, time: float) -> None:
        """Pass bytes in both directions at bench time `time` (s)."""
        terminal = self._terminal
        if terminal is None:
            self._electronics.take(time, 0)
            return
        is_open = terminal.is_open
        if is_open and not self._was_open:
            self._electronics.opened(time)
        self._was_open = is_open
        if is_open:
            data = terminal.read()
            if data:
                self._electronics.receive(data, time)
        arrived = self._electronics.take(time, terminal.speed if is_open else 0)
        if is_open and arrived:
            terminal.write(arrived)

    def unplug(self) -> None:
        """Pull it out; the computer's reads fail."""
        if self._terminal is not None:
            self._terminal.close()
            self._terminal = None

    def replug(self) -> str:
        """Pull it out and put it in again; its new device."""
        spares = [Terminal()]
        while spares[-1].name == self.name:
            spares.append(Terminal())
        new = spares.pop()
        self.unplug()
        for spare in spares:
            spare.close()
        self._terminal, self.name = new, new.name
        self._was_open = False
        return self.name
