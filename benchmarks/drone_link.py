"""The link to the drone in figures: connecting, parameters, uploading, poses; our driver against cflib's own.

Prints one JSON document. The drone is simulated, in a process of its own, over loopback UDP; both drivers
talk to the same one. Times in ms, rates in 1/s; each figure is the median of ``--repeats``, with the fastest
and the slowest.
"""

import argparse
import json
import os
import platform
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

import cflib.crtp
import numpy as np
from cflib.crazyflie import Crazyflie
from cflib.crtp.udpdriver import UdpDriver

from onboard.app_interface import MEMORY_TYPE_APP
from onboard.link.driver import ResendingUdpDriver, install_driver
from onboard.link.drone import DroneLink
from perchhw.lab_process import SimulatedLab

POLICY_BYTES = 5120
POSES = 20000
PARAMETER = "stabilizer.estimator"
DEADLINE_S = 20.0

Samples = dict[str, list[float]]


def summary(values: list[float]) -> dict[str, float]:
    """Median, least and greatest."""
    return {
        "median": round(statistics.median(values), 4),
        "min": round(min(values), 4),
        "max": round(max(values), 4),
    }


def timed(action: Callable[[], object]) -> float:
    """Duration in ms."""
    start = time.perf_counter()
    action()
    return 1e3 * (time.perf_counter() - start)


@contextmanager
def only(driver: type) -> Iterator[None]:
    """Let cflib use one driver for ``udp://``."""
    before = list(cflib.crtp.CLASSES)
    cflib.crtp.CLASSES[:] = [driver]
    try:
        yield
    finally:
        cflib.crtp.CLASSES[:] = before


def connect(uri: str) -> Crazyflie:
    """An unmodified cflib ``Crazyflie``, fully connected, over whatever driver is installed."""
    crazyflie, connected = Crazyflie(), threading.Event()
    crazyflie.fully_connected.add_callback(lambda _uri: connected.set())
    crazyflie.open_link(uri)
    if not connected.wait(DEADLINE_S):
        raise TimeoutError(f"{uri} not connected within {DEADLINE_S} s")
    return crazyflie


def disconnect(crazyflie: Crazyflie) -> None:
    """Close; the pings first, which cflib would otherwise send into a closing link."""
    crazyflie.link_statistics.stop()
    crazyflie.close_link()


def cflib_parameter(crazyflie: Crazyflie) -> Callable[[], None]:
    """One parameter request and its answer."""
    answered = threading.Event()
    group, name = PARAMETER.split(".")
    crazyflie.param.add_update_callback(group, name, lambda _name, _value: answered.set())

    def ask() -> None:
        answered.clear()
        crazyflie.param.request_param_update(PARAMETER)
        if not answered.wait(DEADLINE_S):
            raise TimeoutError(PARAMETER)

    return ask


def cflib_upload(crazyflie: Crazyflie, content: bytes) -> Callable[[], None]:
    """Write and read back by cflib's memory layer."""
    (memory,) = crazyflie.mem.get_mems(MEMORY_TYPE_APP)
    done = threading.Event()
    received = bytearray()

    def on_read(_memory: object, _address: int, data: bytes) -> None:
        received[:] = data
        done.set()

    crazyflie.mem.mem_write_cb.add_callback(lambda _memory, _address: done.set())
    crazyflie.mem.mem_read_cb.add_callback(on_read)

    def upload() -> None:
        for start in (
            lambda: crazyflie.mem.write(memory, 0, content, flush_queue=True),
            lambda: crazyflie.mem.read(memory, 0, len(content)),
        ):
            done.clear()
            start()
            if not done.wait(DEADLINE_S):
                raise TimeoutError("memory transfer")
        if bytes(received) != content:
            raise ValueError("read back something else")

    return upload


def pose_rate(send: Callable[[tuple[float, ...], tuple[float, ...]], None]) -> float:
    """Poses a second that one thread can hand to the socket."""
    position, quaternion = (0.1, 0.2, 0.3), (0.0, 0.0, 0.0, 1.0)
    start = time.perf_counter()
    for _ in range(POSES):
        send(position, quaternion)
    return POSES / (time.perf_counter() - start)


def cflib_round(uri: str, driver: type, content: bytes) -> Samples:
    """One connection by cflib's own layers over ``driver``."""
    opened: list[Crazyflie] = []
    with only(driver):
        connecting = timed(lambda: opened.append(connect(uri)))
    crazyflie = opened[0]
    ask = cflib_parameter(crazyflie)
    return {
        "connect_ms": [connecting],
        "param_round_trip_ms": [timed(ask) for _ in range(100)],
        "upload_and_read_back_ms": [timed(cflib_upload(crazyflie, content))],
        "poses_per_s": [pose_rate(crazyflie.loc.send_extpose)],
        "close_ms": [timed(lambda: disconnect(crazyflie))],
    }


def link_round(uri: str, content: bytes) -> Samples:
    """Two connections by ``DroneLink``: the first reads the tables of contents, the second knows them."""
    opened: list[DroneLink] = []
    with tempfile.TemporaryDirectory() as tables:
        connecting, again = (
            timed(lambda: opened.append(DroneLink.open(uri, toc_cache=Path(tables)))) for _ in range(2)
        )
    opened[0].close()
    link = opened[1]
    return {
        "connect_ms": [connecting],
        "connect_again_ms": [again],
        "param_round_trip_ms": [timed(lambda: link.param(PARAMETER)) for _ in range(100)],
        "upload_and_read_back_ms": [timed(lambda: write_and_compare(link, content))],
        "poses_per_s": [pose_rate(link.send_pose)],
        "close_ms": [timed(link.close)],
    }


def write_and_compare(link: DroneLink, content: bytes) -> None:
    """Write and read back as an upload does, by what the link has within."""
    link._memories.write(MEMORY_TYPE_APP, content, 0)
    if link.read_memory(MEMORY_TYPE_APP, 0, len(content)) != content:
        raise ValueError("read back something else")


def measure(uri: str, repeats: int, content: bytes) -> dict[str, dict[str, dict[str, float]]]:
    """All ways to the drone in turn, so that whatever else the machine does is shared out."""
    ways: dict[str, Callable[[], Samples]] = {
        "cflib_over_its_own_driver": lambda: cflib_round(uri, UdpDriver, content),
        "cflib_over_our_driver": lambda: cflib_round(uri, ResendingUdpDriver, content),
        "drone_link": lambda: link_round(uri, content),
    }
    collected: dict[str, Samples] = {name: {} for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            for figure, values in way().items():
                collected[name].setdefault(figure, []).extend(values)
    return {name: {k: summary(v) for k, v in samples.items()} for name, samples in collected.items()}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--uri", help="a drone to measure; default: a simulated one")
    parser.add_argument("--repeats", type=int, default=5)
    arguments = parser.parse_args()
    content = bytes(np.random.default_rng(1).integers(0, 256, POLICY_BYTES, dtype=np.uint8))
    with SimulatedLab("drone", ("--drone-port", "0")) as simulated:
        uri = arguments.uri or simulated.drones[0]
        install_driver(for_everybody=True)
        ways = measure(uri, arguments.repeats, content)
    document = {
        "benchmark": "drone_link",
        "repeats": arguments.repeats,
        "bytes_uploaded": POLICY_BYTES,
        "ways": ways,
        "machine": {"cpus": os.cpu_count(), "python": platform.python_version(), "cflib": version("cflib")},
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
