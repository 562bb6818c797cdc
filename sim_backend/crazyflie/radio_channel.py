"""The air between a Crazyradio and the drone: so many packets a second each way, and no more.

Every exchange carries one packet up and one down. Bitcraze's own tests demand 350 exchanges a second at 28
bytes and 300 log packets a second; the firmware's queue towards the radio holds 200 packets (``crtp.c``,
2a18fc29). Log data and console text that find it full are lost; answers wait for a place, see
:mod:`sim_backend.crazyflie.reception`.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

RATE_HZ = 350.0
LATENCY_S = (0.0005, 0.002)
"""Shortest and longest time in the air, repetitions by the radio included; uniform."""
DRONE_QUEUE = 200
HOST_QUEUE = 50
"""Packets that wait at the host; more than these its driver gives up."""

Deliver = Callable[[], None]


@dataclass(slots=True)
class _Direction:
    """One way. Packets leave in turn, one a slot, and do not overtake each other."""

    limit: int
    rng: np.random.Generator
    waiting: deque[Deliver]
    in_the_air: deque[tuple[float, Deliver]]
    next_slot: float = 0.0

    def add(self, now: float, deliver: Deliver) -> None:
        """A packet more, or lost for want of a place."""
        if len(self.waiting) >= self.limit:
            return
        if not self.waiting:
            self.next_slot = max(self.next_slot, now)
        self.waiting.append(deliver)

    def move(self, now: float) -> list[Deliver]:
        """What arrives until `now`."""
        while self.waiting and self.next_slot <= now:
            arrival = self.next_slot + float(self.rng.uniform(*LATENCY_S))
            self.in_the_air.append((arrival, self.waiting.popleft()))
            self.next_slot += 1.0 / RATE_HZ
        arrived = []
        while self.in_the_air and self.in_the_air[0][0] <= now:
            arrived.append(self.in_the_air.popleft()[1])
        return arrived


class RadioChannel:
    """Both ways of one drone's radio.

    Args:
        rng: of the times in the air.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._up = _Direction(HOST_QUEUE, rng, deque(), deque())
        self._down = _Direction(DRONE_QUEUE, rng, deque(), deque())

    @property
    def has_room(self) -> bool:
        """Whether the drone's queue takes another packet."""
        return len(self._down.waiting) < self._down.limit

    def up(self, now: float, deliver: Deliver) -> None:
        """Send a packet to the drone at `now` [s]."""
        self._up.add(now, deliver)

    def down(self, now: float, deliver: Deliver) -> None:
        """Send a packet to the host."""
        self._down.add(now, deliver)

    def move(self, now: float) -> None:
        """Deliver what has arrived until `now`."""
        for direction in (self._down, self._up):
            for deliver in direction.move(now):
                deliver()

    def forget(self) -> None:
        """The drone restarts: what waited there is gone."""
        self._down.waiting.clear()
