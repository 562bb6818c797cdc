"""The served bench: an event loop that lives it at a multiple of real time behind sockets and terminals."""

import asyncio
import contextlib
import gc
import heapq
import itertools
import os
import sys
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from onboard.clock import Clock
from onboard.vehicle import load_vehicle
from sim_backend.bench.assistant_server import AssistantServer
from sim_backend.bench.bench import DT, Bench, BenchOptions
from sim_backend.bench.errors import BenchInputError
from sim_backend.bench.faults import INSTRUMENTS, BenchFaults
from sim_backend.bench.operator import CannotDo, SimulatedOperator
from sim_backend.bench.ports import AskedPort, BoardPort, Electronics, InstrumentPort
from sim_backend.crazyflie.faults import DatagramFaults
from sim_backend.crazyflie.server import ACTIVITY_TIMEOUT_MS, CrazyflieServer
from sim_backend.engine_name import usable_engine
from sim_backend.lab_faults import Faults

PERIOD_S = 0.002
"""Real time between two rounds of the loop."""
POLL_TICKS = 2
"""Bench ms between two looks at the drone's log blocks."""
LAG_LIMIT_S = 0.2
"""Real time that is caught up at most; what is beyond is given up and counted."""
ROUND_LIMIT_S = 0.005
"""Real time after which a round that is behind lets the sockets have their turn."""
PACE_MAX = 50.0
SCHEMES = {"balance": "mtsics://", "korad": "korad://"}
"""What stands before a port in the ready line where the port alone would mean something else."""
HURRIED_PATIENCE = 10.0
"""How many times as long as usual a client of a hurried bench may be silent."""


@dataclass(frozen=True, slots=True)
class BenchSettings:
    """What is served.

    Attributes:
        vehicle, legs: vehicle file or known name, and leg design (None: the vehicle's own).
        drone_port: UDP port of the drone; 0 takes a free one.
        seed: of all random numbers.
        pace: bench s in a real s.
        faults: what goes wrong.
        host: local address of everything.
    """

    vehicle: str = "crazyflie21-upgraded"
    legs: str | None = None
    drone_port: int = 0
    seed: int = 0
    pace: float = 1.0
    faults: Faults = field(default_factory=Faults)
    host: str = "127.0.0.1"


class PacedServer(CrazyflieServer):
    """A drone whose clock runs `pace` times as fast as the client's, which pings at its own rate."""

    pace = 1.0

    @property
    def connected(self) -> bool:
        """A client is there, and the radio was not silent for a second of the client's time.

        At more than real pace it may be silent for longer: a machine that has so much to do does not always
        let a client speak every second, and a drone that then forgot its log blocks would end what it does.
        """
        silence = self._firmware.tick_ms() - self._last_packet_ms
        patience = 1.0 if self.pace <= 1.0 else HURRIED_PATIENCE * self.pace
        return self._peer is not None and silence < ACTIVITY_TIMEOUT_MS * patience


class ServedBench:
    """A bench that answers: ``prepare()``, ``await start()``, ``await run(stop)``, ``await close()``.

    Attributes:
        settings: as given.
        bench: the bench, from :meth:`prepare` on.
        ports: of the instruments by name, from :meth:`start` on.
        dropped: bench s that were given up because the machine was too slow.
    """

    def __init__(self, settings: BenchSettings, clock: Clock = time.monotonic) -> None:
        """Raises BenchInputError when the pace is not possible."""
        if not 0.0 < settings.pace <= PACE_MAX:
            raise BenchInputError(f"pace {settings.pace:g}: must be above 0 and at most {PACE_MAX:g}")
        self.settings = settings
        self.ports: dict[str, InstrumentPort] = {}
        self.dropped = 0.0
        self._clock = clock
        self._waiting: list[tuple[float, int, asyncio.Future[None]]] = []
        self._order = itertools.count()
        self._unplugged = False
        self._cleanup = contextlib.AsyncExitStack()

    def prepare(self) -> None:
        """Read the vehicle and compile; takes long the first time, and needs no event loop.

        Raises:
            InputError: the vehicle or a fault is not known.
            BenchInputError: the vehicle cannot be put on the bench.
        """
        settings = self.settings
        vehicle = load_vehicle(settings.vehicle, settings.legs)
        faults = BenchFaults.parse(settings.faults.bench)
        options = BenchOptions(settings.seed, faults, settings.faults.drone, engine=usable_engine(None))
        warm_up = Bench(vehicle, options)
        operator = SimulatedOperator(warm_up, lambda name: name)
        strings = {"string_distance_top": 0.06, "string_distance_bottom": 0.06, "string_length": 0.6}
        operator.perform({"do": "hang", "axis": [0, 0, 1], **strings})
        warm_up.run(2.0)  # compiles, or loads, every kernel before the clock runs
        self.bench = Bench(vehicle, options)

    async def start(self) -> None:
        """Make everything accept connections.

        Raises:
            SimulationError: a port is taken.
        """
        settings, bench = self.settings, self.bench
        rng = np.random.default_rng((settings.seed, 1))
        self._link = DatagramFaults(rng, loss=settings.faults.drone.link_loss)
        self.server = PacedServer(bench.firmware, settings.host, settings.drone_port, faults=self._link)
        self.server.pace = settings.pace
        await self.server.start()
        self._cleanup.callback(self.server.close)
        electronics: dict[str, Electronics] = {
            "tachometer": BoardPort(bench.tachometer, rng),
            "scale": BoardPort(bench.scale, rng),
            "supply": AskedPort(bench.scpi),
            "balance": AskedPort(bench.balance),
            "korad": AskedPort(bench.korad),
        }
        if bench.options.faults.wrong_device:
            boards = electronics["scale"], electronics["tachometer"]
            electronics["tachometer"], electronics["scale"] = boards
        for name in INSTRUMENTS:
            self.ports[name] = port = InstrumentPort(electronics[name])
            self._cleanup.callback(port.unplug)
        self.operator = SimulatedOperator(bench, self.replug)
        self.assistant = AssistantServer(self.operator, self.wait_until, settings.host)
        await self.assistant.start()
        self._cleanup.push_async_callback(self.assistant.close)
        gc.collect()
        gc.freeze()

    def ready(self) -> dict[str, Any]:
        """The ready line."""
        instruments = {name: SCHEMES.get(name, "") + port.name for name, port in self.ports.items()}
        return {
            "ready": True,
            "drones": [self.server.uri],
            "mocap": [],
            "bench": instruments | {"hands": self.assistant.address},
            "pace": self.settings.pace,
            "processes": {"bench": os.getpid()},
        }

    async def run(self, stop: asyncio.Event) -> None:
        """Live until `stop` is set."""
        self._started = due = self._clock()
        while not stop.is_set():
            self.round()
            due = max(due + PERIOD_S, self._clock() - PERIOD_S)
            await asyncio.sleep(max(0.0, due - self._clock()))

    def round(self) -> None:
        """Bring the bench up to date, then talk."""
        bench, pace = self.bench, self.settings.pace
        lag = (self._clock() - self._started) * pace - self.dropped - bench.time
        if lag > LAG_LIMIT_S * pace:
            self.dropped += lag - LAG_LIMIT_S * pace
            lag = LAG_LIMIT_S * pace
        target, pause = bench.time + lag, self._clock() + ROUND_LIMIT_S
        while bench.time + DT <= target and self._clock() < pause:
            bench.step()
            if bench.ticks % POLL_TICKS == 0:
                self._talk()
        for port in self.ports.values():
            port.poll(bench.time)
        while self._waiting and self._waiting[0][0] <= bench.time:
            future = heapq.heappop(self._waiting)[2]
            if not future.done():
                future.set_result(None)

    def _talk(self) -> None:
        bench = self.bench
        self._link.loss = 1.0 if bench.silent else self.settings.faults.drone.link_loss
        self.server.poll(bench.time)
        unplug = bench.options.faults.unplug
        if unplug is not None and not self._unplugged and bench.time >= unplug.at:
            self._unplugged = True
            self.ports[unplug.instrument].unplug()

    async def wait_until(self, at: float) -> None:
        """Wait for the bench time `at` (s)."""
        if at <= self.bench.time:
            return
        future: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        heapq.heappush(self._waiting, (at, next(self._order), future))
        await future

    def replug(self, instrument: str) -> str:
        """Pull an instrument's plug and put it in again; its new device.

        Raises:
            CannotDo: there is no such instrument.
        """
        if instrument not in self.ports:
            raise CannotDo(f"replug {instrument!r}? There are {', '.join(INSTRUMENTS)}")
        return self.ports[instrument].replug()

    async def close(self) -> None:
        """Close everything; may be called after a start that failed."""
        await self._cleanup.aclose()
        if self.dropped >= 0.01:
            with contextlib.suppress(BrokenPipeError):
                sys.stderr.write(
                    f"bench: too slow for this pace, {self.dropped:.2f} s of bench time dropped\n"
                )
