"""A real host, a real link and a simulated drone at real pace, with a bad network between them."""

import contextlib
import json
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from onboard.closing import Closing
from onboard.link import reboot
from onboard.link.uri import parse_udp_uri
from onboard.supervisor_info import SupervisorInfo
from tests.link.faulty_network import Faults, FaultyNetwork

STOP, KICK, LAND = b"\x91\x03", b"\x91\x04", b"\x80\x08"
_ZERO_SETPOINT_HEADER = 0x30
_FLIGHT_S = 60.0
_TRIES = 5
_ASK = b"\x90\x0c"
_ANSWER_S = 0.02
_T = TypeVar("_T")


class NotInTheAir(Exception):
    """The flight ended before it came so far: a machine that is too slow for real time, usually."""


def when_it_flies(scene: Callable[[], _T]) -> _T:
    """What comes of a scene in the air; a flight that ends before it is flown again."""
    for _ in range(_TRIES - 1):
        with contextlib.suppress(NotInTheAir):
            return scene()
    return scene()


def is_stop(packet: bytes) -> bool:
    """An emergency stop of the host."""
    return len(packet) > 1 and bytes((packet[0] & 0xF3, packet[1])) == STOP


def is_order_to_land(packet: bytes) -> bool:
    """An order to the drone's planner to land."""
    return len(packet) > 1 and bytes((packet[0] & 0xF3, packet[1])) == LAND


def is_other_stop(packet: bytes) -> bool:
    """A kick, without which the drone's watchdog never starts, or cflib's closing zero setpoint."""
    return packet[0] & 0xF3 == _ZERO_SETPOINT_HEADER or (
        len(packet) > 1 and bytes((packet[0] & 0xF3, packet[1])) == KICK
    )


class Witness:
    """Asks the drone itself, past every fault: supervisor bits, and nothing else."""

    def __init__(self, drone: str) -> None:
        address = parse_udp_uri(drone)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((address.host, address.port))

    def bits(self, within: float = 2.0) -> SupervisorInfo:
        """The drone's supervisor now."""
        deadline = time.monotonic() + within
        self._forget_late_answers()
        while time.monotonic() < deadline:
            self._socket.send(_ASK)
            try:
                answer = self._socket.recv(64)
            except TimeoutError:
                continue
            if len(answer) >= 4 and answer[0] & 0xF3 == 0x90 and answer[1] == 0x8C:
                return SupervisorInfo(int.from_bytes(answer[2:4], "little"))
        raise TimeoutError("the drone does not answer its witness")

    def _forget_late_answers(self) -> None:
        self._socket.settimeout(0.0)
        with contextlib.suppress(BlockingIOError):
            while True:
                self._socket.recv(64)
        self._socket.settimeout(_ANSWER_S)

    def motors_off(self, within: float) -> float | None:
        """When the drone no longer lets its motors turn, on the monotonic clock (s), or None."""
        deadline = time.monotonic() + within
        while time.monotonic() < deadline:
            if not self.bits().can_fly:
                return time.monotonic()
            threading.Event().wait(0.005)
        return None

    def close(self) -> None:
        """Ask no more."""
        self._socket.close()


class Airborne(Closing):
    """A host process that flies one drone through a :class:`FaultyNetwork`, again and again.

    Args:
        drone, mocap: URIs in the lab.
        folder: for the records.
        rng: of the network.
        host: further arguments of :mod:`tests.flight.flying_host`.

    Attributes:
        network: between host and drone.
        witness: past the network.
        stops: when each stop packet of the host reached the drone, on the monotonic clock, s.
        attempted: when each stop packet of the host came to the network, likewise.
        landings: when each order to land reached the drone, likewise.
    """

    def __init__(
        self, drone: str, mocap: str, folder: Path, rng: np.random.Generator, host: tuple[str, ...] = ()
    ) -> None:
        self._drone = drone
        self._folder = folder
        self._flights = 0
        self._pressed = False
        self.witness = Witness(drone)
        self.network = FaultyNetwork(parse_udp_uri(drone).port, rng, Faults())
        self.stops: list[float] = []
        self.attempted: list[float] = []
        self.landings: list[float] = []
        self.network.watch = self._note
        self.withhold()
        self._lines: queue.Queue[dict[str, Any] | None] = queue.Queue()
        command = ["-m", "tests.flight.flying_host", "--drone", self.network.uri, "--mocap", mocap]
        self.host = subprocess.Popen(
            [sys.executable, *command, *host], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        threading.Thread(target=self._read, daemon=True).start()
        self._wait_for("ready")

    def withhold(self, everything_that_stops: bool = False, watchdog: bool = False) -> None:
        """Let only the host's stop packets stop the drone; or nothing at all; or also its watchdog."""

        def withheld(packet: bytes) -> bool:
            if is_stop(packet):
                self.attempted.append(time.monotonic())
                return everything_that_stops
            return not watchdog and is_other_stop(packet)

        self.network.withheld = withheld

    def take_off(self, until: str = "taking off", hang_s: float | None = None) -> None:
        """Put the drone on its start mark, fly, and return when the flight is in phase `until`."""
        self.network.faults = Faults()
        self.network.frozen.clear()
        reboot(self._drone, even_flying=True)
        self.stops.clear()
        self.attempted.clear()
        self.landings.clear()
        self._flights += 1
        self._pressed = False
        assert self.host.stdin is not None
        hang = "" if hang_s is None else f" {hang_s}"
        self.host.stdin.write(f"{self._folder / str(self._flights)}{hang}\n")
        self.host.stdin.flush()
        self._wait_for("phase", until)

    def reaches(self, phase: str) -> dict[str, Any]:
        """Wait until the flight is in this phase, too."""
        return self._wait_for("phase", phase)

    def key(self) -> float:
        """Press a key; when, on the monotonic clock, s.

        The first is Ctrl-C. The second is SIGTERM, which counts the same: of two equal signals the system
        keeps one when the host did not run in between, as on a busy machine.
        """
        now = time.monotonic()
        os.kill(self.host.pid, signal.SIGTERM if self._pressed else signal.SIGINT)
        self._pressed = True
        return now

    def ended(self) -> dict[str, Any]:
        """How the host says that its flight ended."""
        return self._wait_for("ended")

    def close(self) -> None:
        """End the host and the network."""
        self.host.kill()
        self.host.wait()
        for stream in (self.host.stdin, self.host.stdout):
            if stream is not None:
                stream.close()
        self.network.close()
        self.witness.close()

    def _note(self, packet: bytes, now: float) -> None:
        if is_stop(packet):
            self.stops.append(now)
        elif is_order_to_land(packet):
            self.landings.append(now)

    def _read(self) -> None:
        assert self.host.stdout is not None
        for line in self.host.stdout:
            self._lines.put(json.loads(line))
        self._lines.put(None)

    def _wait_for(self, key: str, value: str | None = None) -> dict[str, Any]:
        deadline = time.monotonic() + _FLIGHT_S
        while True:
            line = self._lines.get(timeout=max(0.0, deadline - time.monotonic()))
            if line is None:
                raise RuntimeError(f"the host died while it was waited for {key} {value}")
            if key != "ended" and "ended" in line:
                raise NotInTheAir(f"the flight ended while it was waited for {key} {value}: {line}")
            if key in line and value in (None, line[key]):
                return line
