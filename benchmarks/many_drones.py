"""How many simulated drones one lab can fly in real time.

    python benchmarks/many_drones.py [--drones 1 8 16 32] [--seconds 10]

For each number of drones: a lab of its own (``perchhw sim drone --feed-poses``), every drone is armed and
told to hover at 0.5 m, and the lab's processor time is counted against its own time, hovering unheard and
with a client each that logs six variables at 100 Hz. `real_time_factor` is the lab's time that one second of
a core pays for: below 1 the lab goes slower than the clock. What the clients compute is not counted. Heights
are those that the drones log at the end. Prints one JSON document.
"""

import argparse
import contextlib
import json
import os
import socket
import struct
import threading
import time
from pathlib import Path

from machine import machine

from onboard.lab_time.address import TimeAddress
from onboard.lab_time.figures import lab_figures
from perchhw.lab_process import SimulatedLab
from sim_backend.crazyflie.tables import LogTable

ECHO = b"\xf0\x01"
ARM = bytes((9 << 4 | 1, 1, 1))
TAKE_OFF = bytes((8 << 4, 7)) + struct.pack("<BffBf", 0, 0.5, 0.0, 1, 1.5)
VARIABLES = [f"stateEstimate.{axis}" for axis in ("z", "x", "y", "vx", "vy", "vz")]
LOG = (
    bytes((5 << 4 | 1, 6, 1))
    + b"".join(struct.pack("<BH", 7, LogTable.firmware().entry(name).ident) for name in VARIABLES),
    bytes((5 << 4 | 1, 8, 1)) + struct.pack("<H", 10),
)
"""A block of six variables as floats, and its start every 10 ms."""
LOG_DATA = bytes((5 << 4 | 2, 1))
SETTLE_S = 4.0
TICKS_S = os.sysconf("SC_CLK_TCK")


def processor_seconds(pid: int) -> float:
    """User and system time of a process so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS_S


class Clients:
    """A socket for each drone."""

    def __init__(self, uris: list[str]) -> None:
        self._sockets: list[socket.socket] = []
        self.received = 0
        self.heights: dict[int, float] = {}
        for uri in uris:
            host, port = uri.removeprefix("udp://").split(":")
            client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            client.setblocking(False)
            client.connect((host, int(port)))
            self._sockets.append(client)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._live)
        self._thread.start()

    def send(self, *packets: bytes) -> None:
        """The same to every drone."""
        for client in self._sockets:
            for packet in packets:
                client.send(packet)

    def _live(self) -> None:
        """Keep the links alive, and take what comes."""
        while not self._closed.wait(0.05):
            self.send(ECHO)
            for index, client in enumerate(self._sockets):
                with contextlib.suppress(BlockingIOError):
                    while packet := client.recv(64):
                        self.received += 1
                        if packet[:2] == LOG_DATA:
                            (self.heights[index],) = struct.unpack_from("<f", packet, 5)

    def close(self) -> None:
        """Close all."""
        self._closed.set()
        self._thread.join()
        for client in self._sockets:
            client.close()


def wait(lab: TimeAddress, seconds: float) -> None:
    """Until so much of the lab's time has passed."""
    end = lab_figures(lab)["t"] + seconds
    while lab_figures(lab)["t"] < end:
        time.sleep(0.2)


def hovering(drones: int, seconds: float) -> dict[str, object]:
    """A lab with so many drones that hover."""
    arguments = ("--drone-port", "0", "--drones", str(drones), "--feed-poses")
    with SimulatedLab("drone", arguments) as served:
        host, port = served.ready["clock"].split(":")
        lab = TimeAddress(host, int(port))
        clients = Clients(served.drones)
        wait(lab, SETTLE_S)
        clients.send(ARM)
        wait(lab, 1.0)
        clients.send(TAKE_OFF)
        wait(lab, SETTLE_S)
        found: dict[str, object] = {"unheard": cost(served.pid, lab, clients, seconds)}
        clients.send(*LOG)
        found["logging"] = cost(served.pid, lab, clients, seconds)
        found["heights_m"] = [min(clients.heights.values()), max(clients.heights.values())]
        clients.close()
    return found


def cost(pid: int, lab: TimeAddress, clients: Clients, seconds: float) -> dict[str, float]:
    """Processor s of the lab for each of its own s."""
    began, used, heard = lab_figures(lab)["t"], processor_seconds(pid), clients.received
    wait(lab, seconds)
    lived = lab_figures(lab)["t"] - began
    per_second = (processor_seconds(pid) - used) / lived
    return {
        "core_s_per_lab_s": per_second,
        "real_time_factor": 1.0 / per_second,
        "packets_per_lab_s": (clients.received - heard) / lived,
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--drones", type=int, nargs="+", default=[1, 8, 16, 32])
    parser.add_argument("--seconds", type=float, default=10.0)
    arguments, load = parser.parse_args(), os.getloadavg()[0]
    document = {
        "benchmark": "many_drones",
        "drones": {str(n): hovering(n, arguments.seconds) for n in arguments.drones},
        "seconds": arguments.seconds,
        "load_average_before": load,
        **machine(),
    }
    print(json.dumps(document, indent=1))


if __name__ == "__main__":
    main()
