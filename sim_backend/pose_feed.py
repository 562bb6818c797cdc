"""Poses that the lab itself sends to its drones, for clients that bring none: true, at 100 Hz, at once.

What a test wants to see go wrong with them is set here while the world lives.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from mocap_bridge.rotation import multiply
from onboard.arrays import Quaternion, Vector
from sim_backend.crazyflie.interfaces import Localization

PERIOD_TICKS = 10


class Posed(Protocol):
    """What is sent its pose."""

    @property
    def silent(self) -> bool:
        """Whether nothing reaches it."""

    @property
    def localization(self) -> Localization:
        """Where its poses go."""

    def pose(self) -> tuple[str, Vector, Quaternion]:
        """Name, position (m), quaternion (x, y, z, w)."""


@dataclass
class PoseFeed:
    """Sends poses.

    Attributes:
        running: whether it does.
        shift: added to every position, m, world.
        turn: every body appears turned by this about the vertical, rad.
    """

    running: bool = True
    shift: Vector = (0.0, 0.0, 0.0)
    turn: float = 0.0

    def send(self, drones: Iterable[Posed]) -> None:
        """One pose to each drone that hears."""
        if not self.running:
            return
        for drone in drones:
            if drone.silent:
                continue
            _, position, quaternion = drone.pose()
            x, y, z = (a + b for a, b in zip(position, self.shift, strict=True))
            if self.turn:
                about_up = (0.0, 0.0, math.sin(self.turn / 2.0), math.cos(self.turn / 2.0))
                quaternion = multiply(about_up, quaternion)
            drone.localization.external_pose(x, y, z, *quaternion)
