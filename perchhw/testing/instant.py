"""A lab in the process of its test: time goes on only when the test or its client lets it.

Packets take no time: the drone answers at once. :meth:`InstantLab.run_for` lets as much time pass as it is
told, as fast as it can be computed, and waits after each millisecond until the client has worked off what
came. So a callback of cflib acts at the time of its packet, and a flight is the same to the last bit however
busy the machine is.
"""

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from onboard.link.in_process import InProcessDriver, serve_in_process, stop_serving
from onboard.vehicle import load_vehicle
from perchhw.testing.lab import TRUTH_FILE, Lab, LabWaitTimeout, SimulatedDrone
from perchhw.testing.values import MOST_DRONES, LabInputError, number, whole
from sim_backend.acts import LiveFaults
from sim_backend.crazyflie.faults import DatagramFaults
from sim_backend.crazyflie.server import CrazyflieServer
from sim_backend.engine_name import usable_engine
from sim_backend.faults import parse_faults
from sim_backend.pose_feed import PoseFeed
from sim_backend.truth import TruthRecorder
from sim_backend.warm_up import warm_up
from sim_backend.world import DT, Drone, World

CLIENT_PATIENCE_S = 60.0
_CLIENT = ("in process", 0)
_prepared: set[tuple[str, str | None]] = set()


class _Server(CrazyflieServer):
    """A simulated drone's protocol without a socket (an ``InProcessServer``)."""

    def __init__(self, lab: "InstantLab", drone: Drone, radio_id: int, faults: DatagramFaults) -> None:
        super().__init__(drone.firmware, radio_id=radio_id, faults=faults)
        self._lab, self._drone = lab, drone
        self.driver: InProcessDriver | None = None

    def client_came(self, driver: InProcessDriver) -> None:
        """A client is there."""
        self.driver = driver

    def client_left(self, driver: InProcessDriver) -> None:
        """It has closed."""
        self.driver = None

    def take(self, datagram: bytes) -> None:
        """A packet of the client. Parameters take effect at once, in the task that has nothing else to do."""
        with self._lab.lock:
            self._pass(lambda: self._receive(datagram, _CLIENT), datagram)
            self._drone.firmware.run_parameter_task()
            self._lab.talk()

    def poll(self, now: float) -> None:
        """As ever. A client that is there is never silent: cflib's pings come by the clock on the wall."""
        if self.driver is not None:
            self._touch()
        super().poll(now)

    def _put(self, datagram: bytes, address: tuple[str, int]) -> None:
        if self.driver is not None:
            self.driver.deliver(datagram)


class InstantLab(Lab):
    """As :class:`perchhw.testing.Lab`, in this process and at the pace of its test; its drones are at
    ``perchhw://cf1`` and so on, for cflib alone.

    Args:
        folder: for what is recorded of it.
        drones, vehicle, legs, seed, poses, faults: as of a :class:`perchhw.testing.Lab`.
    """

    def __init__(
        self,
        folder: Path,
        *,
        drones: int = 1,
        vehicle: str = "crazyflie21-upgraded",
        legs: str | None = None,
        seed: int = 0,
        poses: bool = True,
        faults: Sequence[str] = (),
    ) -> None:
        drones, seed = whole("drones", drones, 1, MOST_DRONES), whole("seed", seed, 0)
        wrong = parse_faults(faults).drone
        _refuse_loss(wrong.link_loss)
        described, engine = load_vehicle(vehicle, legs), usable_engine(None)
        if (vehicle, legs) not in _prepared:
            warm_up(described, engine)
            _prepared.add((vehicle, legs))
        self.lock = threading.RLock()
        self.folder, self.mocap = folder, []
        folder.mkdir(parents=True, exist_ok=True)
        self._running, self._shift, self._turn = True, (0.0, 0.0, 0.0), 0.0
        self._truth = TruthRecorder(folder / TRUTH_FILE)
        feed = PoseFeed() if poses else None
        self._world = World(
            described,
            drones=drones,
            seed=seed,
            faults=wrong,
            truth=self._truth,
            engine=engine,
            poses=feed,
        )
        self._links = [
            DatagramFaults(np.random.default_rng((seed, i)), loss=wrong.link_loss) for i in range(drones)
        ]
        self._servers = [
            _Server(self, drone, 0xE7 + i, link)
            for i, (drone, link) in enumerate(zip(self._world.drones, self._links, strict=True))
        ]
        self._acts = LiveFaults(self._world, self._links, feed)
        self.drones = [
            SimulatedDrone(self, i, serve_in_process(drone.name, server))
            for i, (drone, server) in enumerate(zip(self._world.drones, self._servers, strict=True))
        ]

    def tick(self) -> None:
        """One millisecond."""
        self._world.step()
        self._acts.due()
        self.talk()

    def talk(self) -> None:
        """The drones send what has become due; one that hangs or has no power hears and says nothing."""
        for drone, link, server in zip(self._world.drones, self._links, self._servers, strict=True):
            if drone.silent:
                link.loss = 1.0
            server.poll(self._world.time)

    def run_for(self, seconds: float) -> None:
        """Let so much of the lab's time pass."""
        steps = round(number("seconds", seconds, 0.0) / DT)
        self._settle()
        for _ in range(steps):
            with self.lock:
                self.tick()
            self._settle()

    def wait_until(self, holds: Callable[[], object], within: float) -> None:
        """Let time pass until it holds, looked at every 10 ms.

        Raises:
            LabWaitTimeout: it did not within so many s of the lab's time.
        """
        end = self.time + number("within", within, 0.0)
        while not holds():
            if self.time >= end:
                raise LabWaitTimeout(
                    f"it did not come to pass within {within:g} s of the lab's time; what is: {self.look()}"
                )
            self.run_for(0.01)

    def sleep(self, seconds: float) -> None:
        """For ``time.sleep``: on the main thread the lab's time passes, elsewhere that of the clock."""
        if threading.current_thread() is threading.main_thread():
            self.run_for(seconds)
        else:
            _sleep(seconds)

    def pass_until_logged(self, logger: Any) -> None:
        """For cflib's ``SyncLogger``, which waits for a sample without looking at any clock: on the main
        thread the lab's time passes until there is one.

        Raises:
            LabWaitTimeout: none came within a minute of the lab's time.
        """
        if threading.current_thread() is not threading.main_thread():
            return
        end = self.time + CLIENT_PATIENCE_S
        while logger.is_connected() and logger._queue.empty():
            if self.time >= end:
                raise LabWaitTimeout(
                    f"SyncLogger: no sample within {CLIENT_PATIENCE_S:g} s of the lab's time"
                )
            self.run_for(DT)

    def _settle(self) -> None:
        """Wait until every client has worked off what came."""
        for server in self._servers:
            driver = server.driver
            if driver is not None and not driver.settled(CLIENT_PATIENCE_S):
                raise LabWaitTimeout(
                    f"{driver.uri}: the client works for {CLIENT_PATIENCE_S:g} s on a packet"
                )

    def ask(self, do: str, **values: Any) -> dict[str, Any]:
        """What a :class:`perchhw.testing.Lab` asks its process."""
        if values.get("act") == "loss":
            _refuse_loss(values["value"])
        with self.lock:
            return self._acts.do({"do": do, **values})

    def close(self) -> None:
        """End this lab; its record is complete then."""
        for drone in self.drones:
            stop_serving(drone.name)
        self._truth.close()


def _refuse_loss(probability: float) -> None:
    """cflib repeats what was lost by the clock on the wall, which stands still here in its eyes."""
    if probability > 0.0:
        raise LabInputError(
            "an instant lab loses no packets: cflib would wait for ever for the first that is lost; take the "
            "fixture `lab`, or freeze() for a drone that says nothing"
        )


_sleep = time.sleep
