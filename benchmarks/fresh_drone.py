"""Time that a fresh simulated drone costs a test until it answers, and that a whole flight costs.

    python benchmarks/fresh_drone.py [--repeats 20]

Three ways to one: a lab of the plugin's fixture ``lab`` (one process serves one lab after another; `parked`
with ``flies=False``), the lab in the test's own process (`instant`), and, as the peer, a process for every
test (``perchhw sim drone``). Seconds by the clock on the wall; a ratio is the peer's median over that of
`lab`. `flight` is take-off, hover and landing by cflib at ``perchhw://``, the fastest of three. Kernels are
compiled before anything is timed. Prints one JSON document.
"""

import argparse
import json
import os
import socket
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cflib.crtp
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
from machine import machine

from onboard.link.in_process import InProcessDriver
from perchhw.lab_process import SimulatedLab
from perchhw.testing import Lab, StageProcess
from perchhw.testing.instant import InstantLab

ECHO = b"\xf0\x01"
"""A packet that every Crazyflie sends back: port 15, channel 0."""


def answers(uri: str) -> None:
    """Wait until the drone has sent a packet back."""
    host, port = uri.removeprefix("udp://").split(":")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.settimeout(60.0)
        client.sendto(ECHO, (host, int(port)))
        client.recv(64)


def of_stage(stage: StageProcess, folder: Path) -> Callable[[], None]:
    """A lab of a process that is there."""

    def once() -> None:
        lab = Lab(stage, folder)
        answers(lab.drones[0].uri)
        lab.close()

    return once


def in_process(folder: Path) -> None:
    """A lab in this process."""
    lab = InstantLab(folder)
    driver = InProcessDriver()
    driver.connect(lab.drones[0].uri, lambda *_: None, lambda *_: None)
    driver.close()
    lab.close()


def of_process() -> None:
    """A process of its own."""
    with SimulatedLab("drone", ("--drone-port", "0")) as lab:
        answers(lab.drones[0])


def flight(folder: Path) -> dict[str, float]:
    """Fly at the pace of the computation; wall s to connect and to fly, lab s of the flight."""
    cflib.crtp.init_drivers()
    lab = InstantLab(folder)
    drone, begin = lab.drones[0], time.perf_counter()
    with SyncCrazyflie(drone.uri, cf=Crazyflie(rw_cache=str(folder / "cache"))) as scf:
        connected, lab_begin = time.perf_counter(), lab.time
        lab.wait_until(lambda: drone.ready, within=10.0)
        scf.cf.supervisor.send_arming_request(True)
        lab.wait_until(lambda: drone.armed, within=5.0)
        lab.run_for(0.2)
        scf.cf.high_level_commander.takeoff(0.5, 1.5)
        lab.run_for(3.0)
        scf.cf.high_level_commander.land(0.0, 1.5)
        lab.wait_until(lambda: drone.position[2] < 0.1, within=5.0)
        flown, lab_flown = time.perf_counter(), lab.time
    lab.close()
    return {"connect_s": connected - begin, "wall_s": flown - connected, "lab_s": lab_flown - lab_begin}


def timed(once: Callable[[], None], repeats: int) -> dict[str, float]:
    """Median and slowest, s, after one that does not count."""
    once()
    took = []
    for _ in range(repeats):
        begin = time.perf_counter()
        once()
        took.append(time.perf_counter() - begin)
    return {"median_s": statistics.median(took), "slowest_s": max(took)}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=20)
    repeats = parser.parse_args().repeats
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with StageProcess() as stage:
            lab = timed(of_stage(stage, folder / "lab"), repeats)
        with StageProcess(parked=True) as stage:
            parked = timed(of_stage(stage, folder / "parked"), repeats)
        instant = timed(lambda: in_process(folder / "instant"), repeats)
        flown = min((flight(folder / "flight") for _ in range(3)), key=lambda took: took["wall_s"])
    process = timed(of_process, max(1, repeats // 4))
    document = {
        "benchmark": "fresh_drone",
        "lab": lab,
        "parked": parked,
        "instant": instant,
        "process_for_every_test": process,
        "ratio": process["median_s"] / lab["median_s"],
        "flight": flown,
        "repeats": repeats,
        "load_average_before": load,
        **machine(),
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
