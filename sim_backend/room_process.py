"""The simulated mocap room as a process of its own, so that it can fail apart from the drones.

``python -m sim_backend.room_process SETTINGS`` (JSON) serves a room, prints one JSON line with its ports and
its process id on stdout, and ends when its standard input does: when the process that started it is gone, for
whatever reason.
"""

import asyncio
import contextlib
import json
import os
import signal
import sys
from dataclasses import dataclass
from typing import Self

import numpy as np

from sim_backend.errors import SimulationError
from sim_backend.room.serve import RoomServer
from sim_backend.room.settings import RoomFaults, RoomSettings

START_TIMEOUT_S = 60.0
"""As long as a busy machine is waited for anywhere in a lab."""
STOP_TIMEOUT_S = 0.5


class RoomProcessError(SimulationError):
    """The room's process did not start."""


@dataclass(frozen=True, slots=True)
class RoomRequest:
    """What the lab wants of its room; goes to the process as JSON. A driven one lives in the feed's time."""

    subjects: tuple[str, ...]
    vicon_port: int
    vicon_udp_port: int
    seed: int
    faults: dict[str, str]
    host: str = "127.0.0.1"
    driven: bool = False

    def encode(self) -> str:
        """As JSON."""
        return json.dumps({name: getattr(self, name) for name in self.__slots__})

    @classmethod
    def decode(cls, text: str) -> Self:
        """From JSON."""
        values = json.loads(text)
        return cls(**values | {"subjects": tuple(values["subjects"])})

    def settings(self) -> RoomSettings:
        """For the room server. Raises FaultError for faults that cannot be used."""
        return RoomSettings(
            subjects=self.subjects,
            host=self.host,
            vicon_port=self.vicon_port,
            vicon_udp_port=self.vicon_udp_port,
            faults=RoomFaults.parse(self.faults),
        )


@dataclass(frozen=True, slots=True)
class RoomPorts:
    """Where the room answers, and its process."""

    vicon: int
    vicon_udp: int
    feed: int
    pid: int


class RoomProcess:
    """The room's process as the lab holds it."""

    def __init__(self, process: asyncio.subprocess.Process, ports: RoomPorts, settings: RoomSettings) -> None:
        self._process = process
        self.ports = ports
        self.settings = settings

    @classmethod
    async def start(cls, request: RoomRequest) -> Self:
        """Start the process and wait until it serves.

        Raises:
            RoomProcessError: it ended, or said nothing for 60 s; its own words are on stderr.
        """
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "sim_backend.room_process",
            request.encode(),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
        )
        try:
            return cls(process, await _ports_of(process), request.settings())
        except BaseException:  # also of whoever is told to end meanwhile
            await _kill(process)
            raise

    async def ended(self) -> int:
        """Wait for the process to end; its exit code."""
        return await self._process.wait()

    async def stop(self) -> None:
        """End the process, within half a second."""
        try:
            await asyncio.wait_for(_end_of(self._process), STOP_TIMEOUT_S)
        except TimeoutError:
            await _kill(self._process)


async def _ports_of(process: asyncio.subprocess.Process) -> RoomPorts:
    """Wait until it serves, and says where."""
    if process.stdout is None:
        raise RoomProcessError("the room's process has no output to read")
    try:
        line = await asyncio.wait_for(process.stdout.readline(), START_TIMEOUT_S)
    except TimeoutError:
        raise RoomProcessError(
            f"the mocap room did not start within {START_TIMEOUT_S:g} s; see its messages above"
        ) from None
    if not line:
        code = await process.wait()
        raise RoomProcessError(f"the mocap room ended with code {code}; see its message above")
    return RoomPorts(**json.loads(line))


async def _kill(process: asyncio.subprocess.Process) -> None:
    with contextlib.suppress(ProcessLookupError):
        process.kill()
    await _end_of(process)


async def _end_of(process: asyncio.subprocess.Process) -> None:
    """End its input and wait for its end. Pipes that were still open when the loop is closed would say so in
    a traceback."""
    if process.stdin is not None:
        process.stdin.close()
        with contextlib.suppress(ConnectionError):
            await process.stdin.wait_closed()
    if process.stdout is not None:
        await process.stdout.read()
    await process.wait()


async def serve(request: RoomRequest) -> None:
    """Serve a room until standard input ends or SIGTERM arrives."""
    loop = asyncio.get_running_loop()
    stop = asyncio.Event()
    # Ctrl-C goes to the whole foreground group; the lab then ends this process by closing its input.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    loop.add_signal_handler(signal.SIGTERM, stop.set)
    reader = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    server = RoomServer(
        request.settings(),
        np.random.default_rng(request.seed),
        driven_seed=request.seed if request.driven else None,
    )
    await server.start()
    try:
        ports = {"vicon": server.vicon_port, "vicon_udp": server.vicon_udp_port, "feed": server.feed_port}
        sys.stdout.write(json.dumps(ports | {"pid": os.getpid()}) + "\n")
        sys.stdout.flush()
        waits = [asyncio.create_task(stop.wait()), asyncio.create_task(reader.read())]
        await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
        for wait in waits:
            wait.cancel()
    finally:
        await server.close()


def main() -> int:
    """Entry point of the process."""
    try:
        with contextlib.suppress(KeyboardInterrupt):
            asyncio.run(serve(RoomRequest.decode(sys.argv[1])))
    except SimulationError as error:
        sys.stderr.write(f"mocap room: {error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
