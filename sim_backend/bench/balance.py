"""A laboratory balance under the same load as the load cell: its display, and MT-SICS on its port.

``SI`` is answered by ``S S <mass> g`` when the load stands still and ``S D <mass> g`` when it does not,
anything else by ``ES``.
"""

import numpy as np

ERROR_G = 0.01
"""Of a reading."""
SHAKE = 0.002
"""Standard deviation of a reading by the propellers' vibration, relative to the thrust."""


class SimulatedBalance:
    """What it weighs; call :meth:`step` with the load.

    Attributes:
        load, thrust: g that push it, without and by the propellers.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._buffer = b""
        self.load = self.thrust = 0.0

    def step(self, load: float, thrust: float) -> None:
        """Put a load (g) on it, and let propellers push it (g)."""
        self.load, self.thrust = load, thrust

    def indication(self) -> float:
        """A reading, g."""
        noise = ERROR_G * float(self._rng.uniform(-1.0, 1.0)) + SHAKE * self.thrust * float(
            self._rng.standard_normal()
        )
        return self.load + self.thrust + noise

    def receive(self, data: bytes) -> bytes:
        """Take what the computer sent, and answer its complete lines."""
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        return b"".join(self._answer(line.strip()) for line in lines)

    def _answer(self, command: bytes) -> bytes:
        if command != b"SI":
            return b"ES\r\n"
        return f"S {'D' if self.thrust else 'S'} {self.indication():10.2f} g\r\n".encode()
