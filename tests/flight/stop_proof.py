"""Stops in the air through the real runner, over a real link whose network fails at the first key.

``python -m tests.flight.stop_proof --stops 1000`` flies so many times, half of them stopped by the flight's
own two keys, half by ``perchhw stop``, at 0 to 300 ms delay each way and 0 to 50 % loss. The drone's
watchdog is off (its kicks are withheld), and so is cflib's closing zero setpoint: only a stop packet of the
host can lock the drone. One JSON document at the end; exit code 1 unless every drone was locked by one.
"""

import argparse
import itertools
import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from onboard.link.uri import parse_udp_uri
from perchhw.lab_process import SimulatedLab
from tests.flight.airborne import Airborne, NotInTheAir, is_stop, when_it_flies
from tests.link.faulty_network import Faults, FaultyNetwork

WAYS = ("keys", "command")
LONGEST_DELAY, LARGEST_LOSS = 0.3, 0.5
_LOCK_WITHIN = 5.0


@dataclass(frozen=True)
class Stop:
    """One stop.

    Attributes:
        way: the flight's own two keys, or ``perchhw stop``.
        delay, loss: of the network from the first key on, s each way and probability.
        keys_apart: between the two keys, s.
        locked_by_packet: it is locked, and a stop packet reached it before.
        to_network: from the second key (or the start of the command) to the first packet of the stop, s.
        to_drone: from there to the first one that reached the drone, s.
        confirmed: whoever stopped it knows that it is locked.
    """

    way: str
    delay: float
    loss: float
    keys_apart: float
    locked_by_packet: bool
    to_network: float | None
    to_drone: float | None
    confirmed: bool

    @property
    def good(self) -> bool:
        """What is to be proven."""
        return self.locked_by_packet and self.confirmed


def stop_once(air: Airborne, drone: str, way: str, rng: np.random.Generator) -> Stop:
    """Take off, break the network, stop, and ask the drone.

    Raises:
        NotInTheAir: there was nothing to stop; nothing is proven or disproven.
    """
    faults = Faults(delay=float(rng.uniform(0.0, LONGEST_DELAY)), loss=float(rng.uniform(0.0, LARGEST_LOSS)))
    apart = float(rng.uniform(0.005, 0.15))
    air.withhold(everything_that_stops=way == "command")
    air.take_off()
    threading.Event().wait(float(rng.uniform(1.0, 2.5)))
    if not air.witness.bits().is_flying:
        air.key()
        raise NotInTheAir(f"the drone does not fly: {air.ended()}")
    air.network.faults = faults
    if way == "keys":
        confirmed, began, attempted, arrived = _by_keys(air, apart)
    else:
        confirmed, began, attempted, arrived = _by_command(drone, faults, rng)
    by_packet = bool(arrived) and _locked(air)
    if way == "keys":
        ended = air.ended()
        confirmed = ended.get("alert") is None and ended.get("phase") == "done"
    else:
        air.network.faults = Faults()
        air.ended()
    return Stop(
        way=way,
        delay=faults.delay,
        loss=faults.loss,
        keys_apart=apart,
        locked_by_packet=by_packet,
        to_network=attempted[0] - began if attempted else None,
        to_drone=arrived[0] - attempted[0] if arrived else None,
        confirmed=confirmed,
    )


def _by_keys(air: Airborne, apart: float) -> tuple[bool, float, list[float], list[float]]:
    air.key()
    threading.Event().wait(apart)
    began = air.key()
    _wait_until(lambda: bool(air.stops))
    return False, began, list(air.attempted), list(air.stops)


def _by_command(
    drone: str, faults: Faults, rng: np.random.Generator
) -> tuple[bool, float, list[float], list[float]]:
    """``perchhw stop`` on a network of its own, which is as bad; the flight's own stops are withheld."""
    arrived: list[float] = []
    attempted: list[float] = []

    def note_arrival(packet: bytes, now: float) -> None:
        if is_stop(packet):
            arrived.append(now)

    def note_attempt(packet: bytes) -> bool:
        if is_stop(packet):
            attempted.append(time.monotonic())
        return False

    with FaultyNetwork(parse_udp_uri(drone).port, rng, faults) as network:
        network.watch, network.withheld = note_arrival, note_attempt
        began = time.monotonic()
        done = subprocess.run(
            [sys.executable, "-m", "perchhw", "stop", "--drone", network.uri, "--json"],
            capture_output=True,
            text=True,
            check=False,
        )
    return done.returncode == 0, began, attempted, arrived


def _locked(air: Airborne) -> bool:
    return _wait_until(lambda: air.witness.bits().is_locked)


def _wait_until(condition: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + _LOCK_WITHIN
    while not condition():
        if time.monotonic() > deadline:
            return False
        threading.Event().wait(0.005)
    return True


def prove(stops: int, seed: int, drones: int = 1) -> list[Stop]:
    """So many stops, on so many drones at a time."""
    ports = ("--drone-port", "0", "--vicon-port", "0", "--vicon-udp-port", "0", "--seed", str(seed))
    numbers, results = itertools.count(), []

    def work(index: int, drone: str, mocap: str, folder: Path) -> None:
        with Airborne(drone, mocap, folder, np.random.default_rng((seed, index, 0))) as air:
            while (number := next(numbers)) < stops:
                stop = stop_when_it_flies(air, drone, number, seed)
                results.append(stop)
                if not stop.good:
                    sys.stderr.write(f"stop {number}: {stop}\n")

    with (
        SimulatedLab("lab", (*ports, "--drones", str(drones))) as lab,
        tempfile.TemporaryDirectory() as folder,
        ThreadPoolExecutor(drones) as threads,
    ):
        workers = [
            threads.submit(work, index, drone, mocap, Path(folder) / f"{index}")
            for index, (drone, mocap) in enumerate(zip(lab.drones, lab.mocap, strict=False))
        ]
        for worker in workers:
            worker.result()
    return results


def stop_when_it_flies(air: Airborne, drone: str, number: int, seed: int) -> Stop:
    """The stop of this number."""
    way = WAYS[number % len(WAYS)]
    return when_it_flies(lambda: stop_once(air, drone, way, np.random.default_rng((seed, number))))


def main() -> int:
    """Prove, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stops", type=int, default=40)
    parser.add_argument("--seed", type=int, default=12)
    parser.add_argument("--drones", type=int, default=1, help="drones that fly at the same time")
    arguments = parser.parse_args()
    begin = time.monotonic()
    stops = prove(arguments.stops, arguments.seed, arguments.drones)
    seconds = (time.monotonic() - begin) / max(1, len(stops))
    document = {
        "stops": len(stops),
        "seconds_per_stop": round(seconds, 2),
        **{way: _summary([stop for stop in stops if stop.way == way]) for way in WAYS},
        "failures": [asdict(stop) for stop in stops if not stop.good],
    }
    sys.stdout.write(json.dumps(document, indent=1) + "\n")
    return 0 if len(stops) == arguments.stops and all(stop.good for stop in stops) else 1


def _summary(stops: list[Stop]) -> dict[str, object]:
    to_network = sorted(stop.to_network for stop in stops if stop.to_network is not None)
    return {
        "stops": len(stops),
        "locked_by_a_packet": sum(stop.locked_by_packet for stop in stops),
        "confirmed": sum(stop.confirmed for stop in stops),
        "to_network_p50_max_s": [round(float(x), 4) for x in (np.median(to_network), max(to_network))]
        if to_network
        else None,
    }


if __name__ == "__main__":
    sys.exit(main())
