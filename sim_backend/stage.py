"""One lab after another in one process, for tests: each test gets a fresh one in milliseconds.

``python -m sim_backend.stage [parked]`` reads commands on standard input, one JSON object a line, and answers
each with one on standard output. It ends with its input.

    {"do": "open", "drones": 1, "vehicle": ..., "legs": null, "seed": 0, "poses": true, "room": false,
     "faults": ["battery_voltage=3.5"], "truth": "truth.csv"}       -> {"drones": [...], "mocap": [...]}
    {"do": "look"}      -> {"t": s, "dropped": s, "drones": [{"position": [x, y, z], ...}]}
    {"do": "drone", "index": 0, "act": "loss", "value": 0.1}   (or freeze, thaw, reboot, brown_out, tumble)
    {"do": "poses", "running": true, "shift": [0, 0, 0], "turn": 0.0}
    {"do": "close"}

What cannot be done is answered with ``{"error": "why"}``, and what was open stays as it was.
"""

import asyncio
import gc
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from onboard.errors import PerchhwError
from onboard.supervisor_info import SupervisorInfo
from onboard.vehicle import load_vehicle
from sim_backend.errors import SimulationError
from sim_backend.faults import parse_faults
from sim_backend.lab import Lab, LabSettings
from sim_backend.warm_up import ANY_VEHICLE, warm_up
from sim_backend.world import Drone

_UPSIDE_DOWN = (1.0, 0.0, 0.0, 0.0)
_TUMBLE_RATE = (15.0, 0.0, 0.0)
_CLEAR_OF_THE_FLOOR = 0.15
_WAIT_S = 0.005
_LABS_A_COLLECTION = 32

Command = dict[str, Any]


class StageError(SimulationError):
    """A command that cannot be carried out."""


class Stage:
    """Holds at most one lab at a time.

    Args:
        parked: its drones never fly, and nothing is compiled.
    """

    def __init__(self, parked: bool) -> None:
        self._parked = parked
        self._lab: Lab | None = None
        self._stop = asyncio.Event()
        self._living: asyncio.Task[None] | None = None
        self._later: set[asyncio.Task[None]] = set()
        self._loss: list[float] = []
        self._closed = 0

    async def do(self, command: Command) -> dict[str, Any]:
        """Carry out one command.

        Raises:
            PerchhwError: it cannot be; the message says why.
        """
        match command.get("do"):
            case "open":
                return await self._open(command)
            case "look":
                return self._look()
            case "drone":
                self._act(command)
            case "poses":
                self._pose(command)
            case "close":
                await self.close()
            case other:
                raise StageError(f"no command {other!r}")
        return {}

    async def _open(self, command: Command) -> dict[str, Any]:
        await self.close()
        settings = LabSettings(
            vehicle=command["vehicle"],
            legs=command["legs"],
            drones=command["drones"],
            drone_port=0,
            with_room=command["room"],
            feed_poses=command["poses"],
            parked=self._parked,
            vicon_port=0,
            vicon_udp_port=0,
            truth=None if self._parked else Path(command["truth"]),
            faults=parse_faults(command["faults"]),
            seed=command["seed"],
        )
        lab = Lab(settings)
        lab.load()
        try:
            await lab.start()
        except PerchhwError:
            await lab.close()
            raise
        self._lab = lab
        self._loss = [link.loss for link in lab.links]
        self._stop = asyncio.Event()
        self._living = asyncio.create_task(lab.run(self._stop))
        line = lab.ready()
        return {"drones": line["drones"], "mocap": line["mocap"]}

    async def close(self) -> None:
        """End the lab that is open, if there is one."""
        for task in self._later:
            task.cancel()
        self._later.clear()
        lab, self._lab = self._lab, None
        if lab is None:
            return
        self._stop.set()
        if self._living is not None:
            await self._living
        await lab.close()
        self._closed += 1
        if self._closed % _LABS_A_COLLECTION == 0:
            gc.unfreeze()  # a lab that begins freezes what there is, so that what earlier ones left stays

    @property
    def _open_lab(self) -> Lab:
        if self._lab is None:
            raise StageError("no lab is open")
        if self._living is not None and self._living.done():
            self._living.result()  # why it has ended
        return self._lab

    def _look(self) -> dict[str, Any]:
        world = self._open_lab.world
        return {"t": world.time, "dropped": world.dropped, "drones": [_truth(d) for d in world.drones]}

    def _pose(self, command: Command) -> None:
        poses = self._open_lab.poses
        if poses is None:
            raise StageError("this lab sends no poses: it was opened without")
        poses.running, poses.turn = bool(command["running"]), float(command["turn"])
        x, y, z = (float(value) for value in command["shift"])
        poses.shift = (x, y, z)

    def _act(self, command: Command) -> None:
        lab, index, value = self._open_lab, int(command["index"]), command.get("value")
        drone = lab.world.drones[index]
        acts: dict[str, Callable[[], object]] = {
            "loss": lambda: self._lose(index, float(value or 0.0)),
            "freeze": lambda: setattr(drone, "frozen", True),
            "thaw": lambda: self._wake(index),
            "reboot": drone.firmware.reboot,
            "brown_out": lambda: self._brown_out(index, float(value or 0.0)),
            "tumble": lambda: _tumble(drone),
        }
        act = acts.get(command["act"])
        if act is None:
            raise StageError(f"no act {command['act']!r}; known: {', '.join(acts)}")
        if self._parked and command["act"] == "tumble":
            raise StageError("a parked drone cannot tumble: ask for one that flies")
        act()

    def _lose(self, index: int, probability: float) -> None:
        self._loss[index] = self._open_lab.links[index].loss = probability

    def _wake(self, index: int) -> None:
        drone = self._open_lab.world.drones[index]
        drone.frozen = drone.dead = False
        self._open_lab.links[index].loss = self._loss[index]

    def _brown_out(self, index: int, seconds: float) -> None:
        """No power for so long, then a boot."""
        lab = self._open_lab
        drone = lab.world.drones[index]
        drone.dead = True
        drone.firmware.power_off()
        until = lab.world.time + seconds

        async def come_back() -> None:
            while lab.world.time < until:
                await asyncio.sleep(_WAIT_S)
            drone.firmware.reboot()
            self._wake(index)

        task = asyncio.create_task(come_back())
        self._later.add(task)
        task.add_done_callback(self._later.discard)


def _tumble(drone: Drone) -> None:
    """Turn it upside down, rolling on: what a hit does to it."""
    state = drone.state
    state["quaternion"][:] = _UPSIDE_DOWN
    state["omega"][:] = _TUMBLE_RATE
    state["position"][2] = max(float(state["position"][2]), _CLEAR_OF_THE_FLOOR)


def _truth(drone: Drone) -> dict[str, Any]:
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


async def serve(parked: bool) -> None:
    """Answer commands until standard input ends."""
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    stage = Stage(parked)
    _answer({"ready": True, "pid": os.getpid()})
    try:
        while line := await reader.readline():
            try:
                _answer(await stage.do(json.loads(line)))
            except PerchhwError as error:
                _answer({"error": str(error)})
    finally:
        await stage.close()


def _answer(document: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(document) + "\n")
    sys.stdout.flush()


def main() -> None:
    """Entry point of the process."""
    parked = sys.argv[1:] == ["parked"]
    if not parked:
        warm_up(load_vehicle(ANY_VEHICLE))
    asyncio.run(serve(parked))


if __name__ == "__main__":
    main()
