"""What a test does to the drones of a world while it lives, and the truth that it reads."""

from collections.abc import Callable
from typing import Any

import numpy as np

from onboard.supervisor_info import SupervisorInfo
from sim_backend.crazyflie.faults import DatagramFaults
from sim_backend.errors import SimulationError
from sim_backend.parked import ParkedDrone
from sim_backend.pose_feed import PoseFeed
from sim_backend.world import Drone, World

_UPSIDE_DOWN = (1.0, 0.0, 0.0, 0.0)
_TUMBLE_RATE = (15.0, 0.0, 0.0)
_CLEAR_OF_THE_FLOOR = 0.15


class ActError(SimulationError):
    """An act that cannot be done."""


class LiveFaults:
    """Faults on demand.

    Args:
        world: a world that flies, or one that is parked.
        links: faults of the drones' links, in their order.
        poses: what sends the drones their poses, or None.
    """

    def __init__(self, world: World, links: list[DatagramFaults], poses: PoseFeed | None) -> None:
        self._world, self._links, self._poses = world, links, poses
        self._loss = [link.loss for link in links]
        self._later: list[tuple[float, Callable[[], None]]] = []

    def do(self, command: dict[str, Any]) -> dict[str, Any]:
        """Carry out a command as :mod:`sim_backend.stage` lists them, and give its answer.

        Raises:
            SimulationError: it cannot be; the message says why.
        """
        match command.get("do"):
            case "look":
                return self.look()
            case "drone":
                self.act(command["index"], command["act"], command.get("value"))
            case "poses":
                self.pose(command["running"], command["shift"], command["turn"])
            case "log":
                self._world.drones[command["index"]].firmware.logs.inject(command["name"], command["value"])
            case "sensor":
                self.disturb(command["index"], command["sensor"], command["offset"])
            case other:
                raise ActError(f"no command {other!r}")
        return {}

    def disturb(self, index: int, sensor: str, offset: list[float]) -> None:
        """From now on, until the drone boots, a sensor shows `offset` too much: gyro (three rad/s, body),
        accelerometer (three m/s2, body) or voltage (one V).

        Raises:
            ActError: no such sensor, or a drone that does not look at it.
        """
        drone = self._world.drones[index]
        if sensor == "voltage":
            (drone.firmware.power.offset,) = offset
            return
        if isinstance(drone, ParkedDrone):
            raise ActError(f"a parked drone does not look at its {sensor}: ask for one that flies")
        x, y, z = offset
        if sensor == "gyro":
            drone.firmware.sensors.offset(gyro=(x, y, z))
        elif sensor == "accelerometer":
            drone.firmware.sensors.offset(acc=(x, y, z))
        else:
            raise ActError(f"no sensor {sensor!r}; known: gyro, accelerometer, voltage")

    def act(self, index: int, what: str, value: float | None) -> None:
        """Do `what` to the drone at `index`: loss (of packets, a probability), freeze, thaw, reboot,
        brown_out (s), tumble.

        Raises:
            ActError: it is not known, or not possible.
        """
        drone, number = self._world.drones[index], float(value or 0.0)
        acts: dict[str, Callable[[], object]] = {
            "loss": lambda: self._lose(index, number),
            "freeze": lambda: setattr(drone, "frozen", True),
            "thaw": lambda: self._wake(index),
            "reboot": drone.firmware.reboot,
            "brown_out": lambda: self._brown_out(index, number),
            "tumble": lambda: _tumble(drone),
        }
        if what not in acts:
            raise ActError(f"no act {what!r}; known: {', '.join(acts)}")
        acts[what]()

    def pose(self, running: bool, shift: list[float], turn: float) -> None:
        """Change the poses that are sent: whether at all, displaced (m), turned about the vertical (rad).

        Raises:
            ActError: none are.
        """
        if self._poses is None:
            raise ActError("this lab sends no poses: it was opened without")
        x, y, z = shift
        self._poses.running, self._poses.shift, self._poses.turn = running, (x, y, z), turn

    def due(self) -> None:
        """Do what was to be done by now."""
        now = self._world.time
        ready = [then for at, then in self._later if at <= now]
        self._later = [(at, then) for at, then in self._later if at > now]
        for then in ready:
            then()

    def look(self) -> dict[str, Any]:
        """The truth: ``t`` (s), ``dropped`` (s), ``drones``."""
        world = self._world
        return {"t": world.time, "dropped": world.dropped, "drones": [truth(d) for d in world.drones]}

    def _lose(self, index: int, probability: float) -> None:
        self._loss[index] = self._links[index].loss = probability

    def _wake(self, index: int) -> None:
        drone = self._world.drones[index]
        drone.frozen = drone.dead = False
        self._links[index].loss = self._loss[index]

    def _brown_out(self, index: int, seconds: float) -> None:
        """No power for so long, then a boot."""
        drone = self._world.drones[index]
        drone.dead = True
        drone.firmware.power_off()

        def come_back() -> None:
            drone.firmware.reboot()
            self._wake(index)

        self._later.append((self._world.time + seconds, come_back))


def _tumble(drone: Drone) -> None:
    """Put it on the floor below, upside down and rolling on: what a crash does to it. In the air it would
    right itself, or not, by an estimate that knows nothing of how it came to be turned."""
    if isinstance(drone, ParkedDrone):
        raise ActError("a parked drone cannot tumble: ask for one that flies")
    state = drone.state
    state["quaternion"][:] = _UPSIDE_DOWN
    state["omega"][:] = _TUMBLE_RATE
    state["velocity"][:] = 0.0
    state["position"][2] = _CLEAR_OF_THE_FLOOR


def truth(drone: Drone) -> dict[str, Any]:
    """Everything that is true of a drone, as JSON."""
    state, firmware = drone.state, drone.firmware
    info = SupervisorInfo(firmware.supervisor_info())
    return {
        "position": np.asarray(state["position"]).tolist(),
        "velocity": np.asarray(state["velocity"]).tolist(),
        "quaternion": np.asarray(state["quaternion"]).tolist(),
        "rates": np.asarray(state["omega"]).tolist(),
        "motors": firmware.ratios.tolist(),
        "voltage": float(state["battery_voltage"]),
        "feet": int(np.asarray(state["foot_attached"]).sum()),
        "powered": bool(firmware.running),
        "ready": info.can_arm,
        "armed": info.is_armed,
        "flying": info.is_flying,
        "tumbled": info.is_tumbled,
        "locked": info.is_locked,
        "boots": firmware.boot_count,
    }
