"""Faults of the link between client and drone, at the level of datagrams."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(slots=True)
class DatagramFaults:
    """Loses, doubles and delays datagrams; independent in both directions. May be changed while it works.

    Echoes have a randomness of their own: a client sends them by its own clock, and nobody else's fate shall
    hang on when.

    Attributes:
        rng: source of all randomness but that of echoes.
        loss: probability that a datagram is lost, 0..1.
        duplicate: probability that a datagram that is not lost arrives twice, 0..1.
        delay_s: shortest and longest delay [s], uniform; each copy has its own, so copies may be reordered.
        lost: datagrams lost so far.
        duplicated: datagrams doubled so far.
    """

    rng: np.random.Generator
    loss: float = 0.0
    duplicate: float = 0.0
    delay_s: tuple[float, float] = (0.0, 0.0)
    lost: int = field(default=0, init=False)
    duplicated: int = field(default=0, init=False)
    _rng_of_echoes: np.random.Generator = field(init=False)

    @property
    def at_work(self) -> bool:
        """Whether datagrams may be lost, doubled or delayed."""
        return self.loss > 0.0 or self.duplicate > 0.0 or self.delay_s[1] > 0.0

    def __post_init__(self) -> None:
        self._rng_of_echoes = self.rng.spawn(1)[0]

    def copies(self, echo: bool = False) -> list[float]:
        """Delays [s] of the copies of one datagram that arrive; empty when it is lost."""
        if not self.at_work:
            return [0.0]
        rng = self._rng_of_echoes if echo else self.rng
        if rng.random() < self.loss:
            self.lost += 1
            return []
        count = 2 if rng.random() < self.duplicate else 1
        self.duplicated += count - 1
        return [float(rng.uniform(*self.delay_s)) for _ in range(count)]
