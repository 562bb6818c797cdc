"""The running lab: an event loop that advances the world and serves its drones and its room.

In real time nobody is waited for; at any other pace the world lives in turns with those who take part
(:mod:`sim_backend.lockstep`).

The drones live in this process; the mocap room is a child process that gets the true poses over loopback UDP,
so that either can be killed without the other. The room ends with the lab, however the lab ends.
"""

import asyncio
import contextlib
import gc
import os
import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from onboard.clock import Clock
from onboard.vehicle import load_vehicle
from sim_backend.crazyflie.build import OURS, Build
from sim_backend.crazyflie.faults import DatagramFaults
from sim_backend.crazyflie.radio_channel import RadioChannel
from sim_backend.crazyflie.server import CrazyflieServer
from sim_backend.engine_name import EngineName, usable_engine
from sim_backend.fault_values import NO_TIME
from sim_backend.lab_description import LabDescription, describe
from sim_backend.lab_faults import Faults
from sim_backend.lockstep import LabTraffic, LockStep
from sim_backend.pace import REAL, Pace
from sim_backend.parked import ParkedWorld
from sim_backend.pose_feed import PoseFeed
from sim_backend.real_time import RealTimeFactor
from sim_backend.room.driven_feed import DrivenFeed
from sim_backend.room.feed import FeedSender
from sim_backend.room.settings import RoomFaults
from sim_backend.room_process import RoomProcess, RoomRequest
from sim_backend.survey import WAND
from sim_backend.truth import TruthRecorder
from sim_backend.turns import TurnsServer
from sim_backend.warm_up import is_first_start, warm_up
from sim_backend.world import Drone, World

PERIOD_S = 0.002
"""Time between two rounds of the loop: 2 ms of world, one poll of each drone, one feed datagram."""
UNHEARD_PERIOD_S = 0.01
"""The same while nobody listens and there is no room: a drone that waits for its client costs little."""
RADIO_ID = 0xE7


@dataclass(frozen=True, slots=True)
class LabSettings:
    """What a lab has.

    Attributes:
        vehicle, legs: vehicle file or known name, and leg design (None: the vehicle's own).
        flashed: vehicle file that the drones' firmware was built with (None: the same).
        drones: number of drones, named cf1, cf2 ...
        drone_port: UDP port of the first drone, the others follow; 0 takes free ones.
        with_drones: serve the drones; without, they rest on their start marks.
        with_room: serve the mocap room.
        feed_poses: the lab sends the drones their poses, for clients that bring none.
        parked: the drones never fly, and nothing is compiled; only in real time and without a room.
        vicon_port, vicon_udp_port: of the room; 0 takes free ones.
        truth: CSV file for the true state, or None.
        truth_motors: whether it has the motors' commands too.
        lab_file: where the lab file of this room is to be; None: in a temporary folder.
        faults: what goes wrong.
        seed: of all random numbers.
        pace: how its time goes.
        engine: the code that the drones run; None: in C where a compiler is found, else the reference.
        build: how the drones' firmware was built.
        radio: packets take their time, and no more of them pass than a radio carries.
        host: local address of everything.
    """

    vehicle: str = "crazyflie21-upgraded"
    legs: str | None = None
    flashed: str | None = None
    drones: int = 1
    drone_port: int = 19850
    with_drones: bool = True
    with_room: bool = True
    feed_poses: bool = False
    parked: bool = False
    vicon_port: int = 18801
    vicon_udp_port: int = 51001
    truth: Path | None = None
    truth_motors: bool = False
    lab_file: Path | None = None
    faults: Faults = field(default_factory=Faults)
    seed: int = 0
    pace: Pace = REAL
    engine: EngineName | None = None
    build: Build = OURS
    radio: bool = False
    host: str = "127.0.0.1"


class LabServer:
    """A lab: ``prepare()``, ``await start()``, then it answers; ``await run(stop)``; ``await close()``.

    Attributes:
        settings: as given.
        world: the world, from :meth:`start` on.
        servers: one a drone, in their order.
        room: the room's process, or None.
        links: the faults of each drone's link; may be changed while it lives.
        poses: what sends the drones their poses, or None; may be changed while it lives.
    """

    def __init__(self, settings: LabSettings, clock: Clock = time.monotonic) -> None:
        self.settings = settings
        self.servers: list[CrazyflieServer] = []
        self.room: RoomProcess | None = None
        self._clock = clock
        self.links: list[DatagramFaults] = []
        self.poses = PoseFeed() if settings.feed_poses else None
        self._truth: TruthRecorder | None = None
        self._feed: FeedSender | None = None
        self._traffic = LabTraffic(self.servers, self.links, settings.radio)
        self._turns = TurnsServer(self._traffic, lambda: self.world.time, self.figures)
        self._factor = RealTimeFactor(clock)
        self._description = LabDescription(settings.lab_file)
        self._started = 0.0

    def prepare(self) -> None:
        """Read the vehicle and compile; takes long the first time, and needs no event loop.

        Raises:
            InputError: the vehicle or a fault is not known.
            SimulationError: the vehicle cannot be simulated, or the lab file would overwrite another.
            NoCompiler: the engine in C is asked for, and there is no compiler.
            CompilationFailed: it does not compile.
        """
        self.load()
        if self.settings.parked:
            return
        if is_first_start(self._engine):
            _say("preparing the simulation (once, takes up to half a minute)")
        warm_up(self._vehicle, self._engine)

    def load(self) -> None:
        """Read the vehicle alone, for a process that has compiled before; errors as :meth:`prepare`."""
        settings = self.settings
        self._description.require_free()
        self._engine = usable_engine(settings.engine)
        self._vehicle = load_vehicle(settings.vehicle, settings.legs)
        self._flashed = None if settings.flashed is None else load_vehicle(settings.flashed, settings.legs)
        RoomFaults.parse(self.settings.faults.room)  # refuses bad faults here, before a process is started

    async def start(self) -> None:
        """Make everything accept connections.

        Raises:
            SimulationError: a port is taken, or the truth file cannot be written.
        """
        settings = self.settings
        names = tuple(f"cf{i + 1}" for i in range(settings.drones))
        surveyed = (WAND,) if settings.faults.drone.survey_at is not NO_TIME else ()
        request = RoomRequest(
            (*names, *surveyed),
            settings.vicon_port,
            settings.vicon_udp_port,
            settings.seed,
            dict(settings.faults.room),
            settings.host,
            driven=settings.pace.waits,
        )
        if settings.with_room:
            self.room = await RoomProcess.start(request)
            await self._open_feed(self.room)
        if settings.truth is not None:
            self._truth = TruthRecorder(settings.truth, settings.truth_motors)
        self.world = self._world()
        if settings.with_drones:
            for index, drone in enumerate(self.world.drones):
                await self._serve(index, drone)
        await self._turns.start(settings.host)
        gc.collect()
        gc.freeze()  # what exists now stays: collections in flight have little to look at

    def _world(self) -> World:
        settings = self.settings
        if settings.parked:
            # To whoever serves it a world like any other, which nothing here tells from one that flies.
            return cast(World, ParkedWorld(self._vehicle, drones=settings.drones, seed=settings.seed))
        return World(
            self._vehicle,
            flashed=self._flashed,
            drones=settings.drones,
            seed=settings.seed,
            faults=settings.faults.drone,
            build=settings.build,
            truth=self._truth,
            engine=self._engine,
            poses=self.poses,
        )

    async def _open_feed(self, room: RoomProcess) -> None:
        host = self.settings.host
        if self.settings.pace.waits:
            self._traffic.feed = DrivenFeed()
            await self._traffic.feed.open(room.ports.feed, host)
        else:
            self._feed = FeedSender(room.ports.feed, host)

    async def _serve(self, index: int, drone: Drone) -> None:
        settings = self.settings
        link = DatagramFaults(
            np.random.default_rng((settings.seed, index)), loss=settings.faults.drone.link_loss
        )
        port = settings.drone_port + index if settings.drone_port else 0
        radio_id = (RADIO_ID + index) & 0xFF
        air = RadioChannel(np.random.default_rng((settings.seed, index, 1))) if settings.radio else None
        server = CrazyflieServer(drone.firmware, settings.host, port, radio_id=radio_id, faults=link, air=air)
        if settings.pace.waits:
            server.by_wall_clock = self._traffic.is_stranger
        await server.start()
        self.servers.append(server)
        self.links.append(link)

    def ready(self) -> dict[str, Any]:
        """The ready line: addresses, process ids, and the lab file, which is written now."""
        clock = f"{self.settings.host}:{self._turns.port}"
        in_lab_time = f"time={clock}" if self.settings.pace.waits else ""
        drones = [server.uri + (in_lab_time and f"?{in_lab_time}") for server in self.servers]
        line: dict[str, Any] = {"ready": True, "drones": drones}
        processes: dict[str, int] = {"lab": os.getpid()}
        line["mocap"] = []
        if self.room is not None:
            ports, host = self.room.ports, self.settings.host
            names = [drone.name for drone in self.world.drones]
            line["mocap"] = [f"vicon://{host}:{ports.vicon}?subject={name}" for name in names]
            line["mocap"] += [f"vicon-udp://{host}:{ports.vicon_udp}?subject={name}" for name in names]
            line["mocap"] = [uri + (in_lab_time and f"&{in_lab_time}") for uri in line["mocap"]]
            processes["room"] = ports.pid
            if self.servers:
                lab = describe(line["drones"], line["mocap"][0], self.settings.vehicle, self.settings.legs)
                line["lab"] = str(self._description.write(replace(lab, clock=clock)))
        return line | {"clock": clock, "processes": processes}

    async def run(self, stop: asyncio.Event) -> None:
        """Live until `stop` is set."""
        watch = asyncio.create_task(self._watch_room()) if self.room is not None else None
        try:
            await (self._in_turns(stop) if self.settings.pace.waits else self._in_real_time(stop))
        finally:
            if watch is not None:
                watch.cancel()

    async def _in_turns(self, stop: asyncio.Event) -> None:
        room, pace = None if self.room is None else self.room.settings, self.settings.pace
        world, servers, turns = self.world, self.servers, self._turns
        await LockStep(world, servers, self._traffic, turns, self._talk, room, pace).run(stop)

    async def _in_real_time(self, stop: asyncio.Event) -> None:
        due = self._started = self._clock()
        while not stop.is_set():
            self.round()
            warning = self._factor.watch(self.world.time)
            if warning is not None:
                _say(warning)
            period = PERIOD_S if self._is_heard() else UNHEARD_PERIOD_S
            due = max(due + period, self._clock() - period)
            await asyncio.sleep(max(0.0, due - self._clock()))

    def _is_heard(self) -> bool:
        return self._feed is not None or any(server.connected for server in self.servers)

    def figures(self) -> dict[str, Any]:
        """What ``perchhw sim status`` shows."""
        pace = self.settings.pace
        return {
            "t": self.world.time,
            "pace": "lockstep" if pace.rate is None else pace.rate if pace.waits else "real",
            "real_time_factor": None if pace.waits else self._factor.recent,
            "dropped_s": self.world.dropped,
            "takes_part": [participant.name for participant in self._turns.participants],
        }

    def round(self) -> None:
        """Bring the world up to date, then talk; a world that is behind talks on its way, so that no log
        block misses its time."""
        now = self._clock()
        if self.settings.with_drones:
            while not self.world.advance(now - self._started, PERIOD_S):
                self._talk(now)
        else:
            self.world.pass_time(now - self._started)
        self._talk(now)
        if self._feed is not None:
            self._feed.send(self.world.time, self.world.seen())

    def _talk(self, now: float) -> None:
        """The drones send what has become due; one that hangs or has no power hears and says nothing."""
        for drone, link, server in zip(self.world.drones, self.links, self.servers, strict=False):
            if drone.silent:
                link.loss = 1.0
            server.poll(now)

    async def _watch_room(self) -> None:
        if self.room is not None:
            code = await self.room.ended()
            if self._traffic.feed is not None:
                self._traffic.feed.room_is_gone()
            _say(f"the mocap room has ended (code {code}); the drones go on")

    async def close(self) -> None:
        """Close sockets and files, end the room. May be called after a start that failed."""
        self._description.remove()
        for server in self.servers:
            server.close()
        if self._feed is not None:
            self._feed.close()
        if self._traffic.feed is not None:
            self._traffic.feed.close()
        await self._turns.close()
        if self.room is not None:
            await self.room.stop()
        if self._truth is not None:
            self._truth.close()
        if self.servers and self.world.dropped > 0.0:
            _say(f"the machine was too slow: {self.world.dropped:.2f} s of simulated time were dropped")


def _say(text: str) -> None:
    with contextlib.suppress(BrokenPipeError):
        sys.stderr.write(f"lab: {text}\n")
        sys.stderr.flush()
