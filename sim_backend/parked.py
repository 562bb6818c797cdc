"""Drones that never fly, for who wants parameters and logs alone: no physics, and nothing is compiled.

Parameters, logs, memories, console, power and supervisor are those of the drone that flies; it can be armed.
Its sensors show nothing, its estimate stays where it began, and its motors do not turn.
"""

from typing import Any

import numpy as np

from onboard.arrays import Quaternion, Vector
from onboard.vehicle import Vehicle
from sim_backend.crazyflie.firmware import Firmware
from sim_backend.crazyflie.interfaces import Localization
from sim_backend.world import DT, LAG_LIMIT_S, Placement, start_marks


class ParkedDrone:
    """One drone on its start mark; as :class:`sim_backend.world.Drone` to whoever serves it.

    Attributes:
        name, firmware, mark, frozen, dead: as of a drone that flies.
        state: its true state, as fields of :data:`sim_backend.physics.state.STATE`.
    """

    def __init__(self, name: str, firmware: Firmware, mark: Placement, voltage: float) -> None:
        self.name = name
        self.firmware = firmware
        self.mark = mark
        self.frozen = False
        self.dead = False
        self.state: dict[str, Any] = {
            "position": np.array([mark.x, mark.y, 0.0]),
            "quaternion": np.array([0.0, 0.0, 0.0, 1.0]),
            "velocity": np.zeros(3),
            "omega": np.zeros(3),
            "battery_voltage": voltage,
            "foot_attached": np.zeros(4, dtype=bool),
            "body_contact": False,
        }

    @property
    def silent(self) -> bool:
        """Whether its radio answers nothing any more."""
        return self.frozen or self.dead

    @property
    def localization(self) -> Localization:
        """Takes poses, and makes nothing of them."""
        return self.firmware.localization

    def step(self) -> None:
        """One ms."""
        if not self.frozen:
            self.firmware.idle(float(self.state["battery_voltage"]))

    def pose(self) -> tuple[str, Vector, Quaternion]:
        """Name, position (m) and quaternion (x, y, z, w)."""
        return self.name, (self.mark.x, self.mark.y, 0.0), (0.0, 0.0, 0.0, 1.0)


class ParkedWorld:
    """All drones; as :class:`sim_backend.world.World` to a lab in real time."""

    def __init__(self, vehicle: Vehicle, *, drones: int = 1, seed: int = 0) -> None:
        self.ticks = 0
        self.dropped = 0.0
        battery = vehicle.battery
        self.drones = [
            ParkedDrone(
                f"cf{i + 1}",
                Firmware(vehicle, np.random.default_rng((seed, i, 0))),
                mark,
                battery.open_circuit_full.value,
            )
            for i, mark in enumerate(start_marks(drones))
        ]

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.ticks * DT

    def advance(self, to_time: float, at_most_s: float = LAG_LIMIT_S) -> bool:
        """Catch up, as :meth:`sim_backend.world.World.advance` does."""
        lag = to_time - self.dropped - self.time
        if lag > LAG_LIMIT_S:
            self.dropped += lag - LAG_LIMIT_S
            lag = LAG_LIMIT_S
        behind = int(lag / DT + 1e-6)
        for _ in range(min(behind, round(at_most_s / DT))):
            self.ticks += 1
            for drone in self.drones:
                drone.step()
        return behind <= round(at_most_s / DT)
