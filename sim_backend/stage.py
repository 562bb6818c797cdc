"""One lab after another in one process, for tests: each test gets a fresh one in milliseconds.

``python -m sim_backend.stage [parked]`` reads commands on standard input, one JSON object a line, and answers
each with one on standard output. It ends with its input.

    {"do": "open", "drones": 1, "vehicle": ..., "legs": null, "seed": 0, "poses": true, "room": false,
     "faults": ["battery_voltage=3.5"], "truth": "truth.csv"}       -> {"drones": [...], "mocap": [...]}
    {"do": "look"}      -> {"t": s, "dropped": s, "drones": [{"position": [x, y, z], ...}]}
    {"do": "drone", "index": 0, "act": "loss", "value": 0.1}   (or freeze, thaw, reboot, brown_out, tumble)
    {"do": "poses", "running": true, "shift": [0, 0, 0], "turn": 0.0}
    {"do": "log", "index": 0, "name": "pm.vbat", "value": 3.1}     (or null: as the drone has it)
    {"do": "sensor", "index": 0, "sensor": "gyro", "offset": [0.1, 0, 0]}      (or accelerometer, voltage)
    {"do": "close"}

What cannot be done is answered with ``{"error": "why"}``, and what was open stays as it was.
"""

import asyncio
import gc
import json
import os
import selectors
import sys
from pathlib import Path
from typing import Any, TextIO

from onboard.errors import PerchhwError
from onboard.vehicle import load_vehicle
from sim_backend.acts import LiveFaults
from sim_backend.engine_name import usable_engine
from sim_backend.errors import SimulationError
from sim_backend.faults import parse_faults
from sim_backend.lab import LabServer, LabSettings
from sim_backend.warm_up import ANY_VEHICLE, warm_up

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
        self._lab: LabServer | None = None
        self._stop = asyncio.Event()
        self._living: asyncio.Task[None] | None = None
        self._acts: LiveFaults | None = None
        self._timekeeper: asyncio.Task[None] | None = None
        self._closed = 0

    async def do(self, command: Command) -> dict[str, Any]:
        """Carry out one command.

        Raises:
            PerchhwError: it cannot be; the message says why.
        """
        match command.get("do"):
            case "open":
                return await self._open(command)
            case "close":
                await self.close()
                return {}
        return self._open_acts.do(command)

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
        lab = LabServer(settings)
        lab.load()
        try:
            await lab.start()
        except PerchhwError:
            await lab.close()
            raise
        self._lab = lab
        self._acts = LiveFaults(lab.world, lab.links, lab.poses)
        self._timekeeper = asyncio.create_task(self._keep_time(self._acts))
        self._stop = asyncio.Event()
        self._living = asyncio.create_task(lab.run(self._stop))
        line = lab.ready()
        return {"drones": line["drones"], "mocap": line["mocap"]}

    async def close(self) -> None:
        """End the lab that is open, if there is one."""
        if self._timekeeper is not None:
            self._timekeeper.cancel()
        lab, self._lab, self._acts = self._lab, None, None
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
    def _open_acts(self) -> LiveFaults:
        if self._acts is None:
            raise StageError("no lab is open")
        if self._living is not None and self._living.done():
            self._living.result()  # why it has ended
        return self._acts

    async def _keep_time(self, acts: LiveFaults) -> None:
        while True:
            acts.due()
            await asyncio.sleep(_WAIT_S)


async def serve(parked: bool) -> None:
    """Answer commands until standard input ends."""
    reader = asyncio.StreamReader()
    if _has_all_at_once(sys.stdin):
        reader.feed_data(sys.stdin.buffer.read())
        reader.feed_eof()
    else:
        loop = asyncio.get_running_loop()
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


def _has_all_at_once(stream: TextIO) -> bool:
    """Whether it is a file or /dev/null, for which no event loop can wait: it never has to."""
    with selectors.DefaultSelector() as selector:
        try:
            selector.register(stream, selectors.EVENT_READ)
        except PermissionError:
            return True
    return False


def _answer(document: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(document) + "\n")
    sys.stdout.flush()


def main() -> None:
    """Entry point of the process."""
    parked = sys.argv[1:] == ["parked"]
    if not parked:
        warm_up(load_vehicle(ANY_VEHICLE), usable_engine(None))
    asyncio.run(serve(parked))


if __name__ == "__main__":
    main()
