"""A lab as a test holds it: drones with their faults, the truth about them, and the lab's time."""

import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from onboard.arrays import Quaternion, Vector
from perchhw.errors import FlightStackError
from perchhw.testing.stage import StageProcess
from perchhw.testing.values import MOST_DRONES, LabInputError, number, whole

if TYPE_CHECKING:
    from cflib.crazyflie import Crazyflie

CONNECT_TIMEOUT_S = 60.0
CLOSE_TIMEOUT_S = 2.0
SILENCE_S = 10.0
"""Of a drone before its link counts as lost, s: a busy machine stands still for longer than a radio may."""
POLL_S = 0.01
STANDSTILL_S = 60.0
"""When the lab's time has not gone on for so long by the machine's clock, waiting for it ends."""
EVENTS_FILE, TRUTH_FILE = "events.jsonl", "truth.csv"


class LabWaitTimeout(FlightStackError, AssertionError):
    """What was waited for did not come to pass in the lab's time given."""


class SimulatedDrone:
    """One drone. What is read here is the truth, by way of the lab and not of the radio.

    Attributes:
        name: as motion capture knows it, ``cf1`` ...
        uri: what a client connects to, ``udp://127.0.0.1:PORT``.
    """

    def __init__(self, lab: "Lab", index: int, uri: str) -> None:
        self.name, self.uri = f"cf{index + 1}", uri
        self._lab, self._index = lab, index

    @property
    def position(self) -> Vector:
        """True position of the body's origin, m: x, y, z, z up."""
        x, y, z = self._look()["position"]
        return (x, y, z)

    @property
    def velocity(self) -> Vector:
        """True velocity, m/s, world."""
        x, y, z = self._look()["velocity"]
        return (x, y, z)

    @property
    def quaternion(self) -> Quaternion:
        """True attitude (x, y, z, w), body to world."""
        x, y, z, w = self._look()["quaternion"]
        return (x, y, z, w)

    @property
    def rates(self) -> Vector:
        """True body rates, rad/s."""
        x, y, z = self._look()["rates"]
        return (x, y, z)

    @property
    def motors(self) -> tuple[int, int, int, int]:
        """What the four motors are given, 0..65535, M1 first."""
        m1, m2, m3, m4 = self._look()["motors"]
        return (m1, m2, m3, m4)

    @property
    def voltage(self) -> float:
        """True battery voltage, V."""
        return float(self._look()["voltage"])

    @property
    def feet(self) -> int:
        """Feet that hold at the ceiling."""
        return int(self._look()["feet"])

    @property
    def powered(self) -> bool:
        """Whether its processor runs."""
        return bool(self._look()["powered"])

    @property
    def ready(self) -> bool:
        """Whether its own checks let it be armed."""
        return bool(self._look()["ready"])

    @property
    def armed(self) -> bool:
        """Whether its motors are armed."""
        return bool(self._look()["armed"])

    @property
    def flying(self) -> bool:
        """Whether its supervisor believes that it flies."""
        return bool(self._look()["flying"])

    @property
    def tumbled(self) -> bool:
        """Whether its supervisor has found it tumbled."""
        return bool(self._look()["tumbled"])

    @property
    def locked(self) -> bool:
        """Whether only a reboot helps."""
        return bool(self._look()["locked"])

    @property
    def boots(self) -> int:
        """How often it has booted; 1 at first."""
        return int(self._look()["boots"])

    @contextmanager
    def connect(self) -> "Iterator[Crazyflie]":
        """A cflib ``Crazyflie``, fully connected by perchhw's driver: a lost packet is repeated, and a drone
        that does not answer for 10 s is an error where cflib alone would wait for ever. Its ``link_uri``
        says so.

        Raises:
            LabInputError: the drone of an instant lab.
        """
        from onboard.link.crazyflie import open_crazyflie
        from onboard.timebase import WALL

        if self.uri.startswith("perchhw://"):
            raise LabInputError(f"{self.uri}: an instant lab's drone is for cflib's own SyncCrazyflie")
        connected = open_crazyflie(
            f"{self.uri}?silence_s={SILENCE_S:g}", timeout_s=CONNECT_TIMEOUT_S, clock=WALL
        )
        try:
            yield connected
        finally:
            connected.close_within(CLOSE_TIMEOUT_S)

    def lose_packets(self, probability: float) -> None:
        """From now on each packet is lost with this probability, each way; 0 ends it, 1 is silence."""
        self._act("loss", number("probability", probability, 0.0, 1.0))

    def freeze(self) -> None:
        """Its firmware hangs: it answers nothing, and the motors keep what they were given."""
        self._act("freeze")

    def thaw(self) -> None:
        """It goes on where it hung."""
        self._act("thaw")

    def reboot(self) -> None:
        """Its processor starts anew: parameters as after power-on, motors off. Once it lies still it is put
        back on its start mark, as a person would."""
        self._act("reboot")

    def brown_out(self, seconds: float = 0.3) -> None:
        """Its voltage breaks down: no power for so long in the lab's time, then it boots."""
        self._act("brown_out", number("seconds", seconds, 0.0))

    def tumble(self) -> None:
        """It crashes: it is upside down on the floor below, and rolls at 15 rad/s."""
        self._act("tumble")

    def set_log(self, variable: str, value: float) -> None:
        """From now on clients that log `variable` (``group.name``) are told `value`; the drone itself goes by
        what it has."""
        number(variable, value)
        self._lab.note("log", drone=self.name, variable=variable, value=value)
        self._lab.ask("log", index=self._index, name=variable, value=value)

    def release_log(self, variable: str) -> None:
        """Clients that log `variable` are told again what the drone has."""
        self._lab.note("log", drone=self.name, variable=variable, value=None)
        self._lab.ask("log", index=self._index, name=variable, value=None)

    def offset_gyro(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> None:
        """From now on, until it boots, its gyro shows so much too much, rad/s about the body's axes."""
        self._offset("gyro", x, y, z)

    def offset_accelerometer(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> None:
        """From now on, until it boots, its accelerometer shows so much too much, m/s2, body's axes."""
        self._offset("accelerometer", x, y, z)

    def offset_voltage(self, volts: float) -> None:
        """From now on, until it boots, it measures so much too much of its battery: a low one by -0.8."""
        self._offset("voltage", volts)

    def _offset(self, sensor: str, *offset: float) -> None:
        offset = tuple(number(f"offset of the {sensor}", part) for part in offset)
        self._lab.note("sensor", drone=self.name, sensor=sensor, offset=offset)
        self._lab.ask("sensor", index=self._index, sensor=sensor, offset=list(offset))

    def _act(self, what: str, value: float | None = None) -> None:
        self._lab.note(what, drone=self.name, value=value)
        self._lab.ask("drone", index=self._index, act=what, value=value)

    def _look(self) -> dict[str, Any]:
        return dict(self._lab.look()["drones"][self._index])


class Lab:
    """A fresh lab of one test, in real time.

    Args:
        stage: the process that serves it.
        folder: for what is recorded of it.
        drones: how many.
        vehicle, legs: what they are.
        seed: of all that is random in it.
        poses: whether the lab sends the drones their poses; without, your code does.
        room: whether there is a motion-capture server as well, which takes half a second.
        faults: those of ``perchhw sim faults``, from the start on.

    Attributes:
        drones: in their order.
        mocap: addresses of the motion-capture server's streams; empty without a room.
        folder: ``truth.csv`` (true states at 100 Hz) and ``events.jsonl`` (faults, in the lab's time).
    """

    def __init__(
        self,
        stage: StageProcess,
        folder: Path,
        *,
        drones: int = 1,
        vehicle: str = "crazyflie21-upgraded",
        legs: str | None = None,
        seed: int = 0,
        poses: bool = True,
        room: bool = False,
        faults: Sequence[str] = (),
    ) -> None:
        self._stage = stage
        self._running, self._shift, self._turn = True, (0.0, 0.0, 0.0), 0.0
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        opened = stage.ask(
            "open",
            drones=whole("drones", drones, 1, MOST_DRONES),
            vehicle=vehicle,
            legs=legs,
            seed=whole("seed", seed, 0),
            poses=poses,
            room=room,
            faults=list(faults),
            truth=str(folder / TRUTH_FILE),
        )
        self.mocap: list[str] = opened["mocap"]
        self.drones = [SimulatedDrone(self, i, uri) for i, uri in enumerate(opened["drones"])]

    @property
    def time(self) -> float:
        """The lab's time, s since it began. Where the machine is too slow it goes slower than the clock."""
        return float(self.look()["t"])

    def run_for(self, seconds: float) -> None:
        """Wait until so much of the lab's time has passed. It lives in real time, as cflib does: this takes
        `seconds` at least."""
        number("seconds", seconds, 0.0)
        begin = self.time
        self.wait_until(lambda: self.time >= begin + seconds, within=seconds + 1.0)

    def wait_until(self, holds: Callable[[], object], within: float) -> None:
        """Wait until it holds, looked at every 10 ms.

        Raises:
            LabWaitTimeout: it did not within so many s of the lab's time.
        """
        number("within", within, 0.0)
        began = last = self.time
        moved = time.monotonic()
        while not holds():
            now = self.time
            if now > last:
                last, moved = now, time.monotonic()
            if now - began > within or time.monotonic() - moved > STANDSTILL_S:
                raise LabWaitTimeout(
                    f"it did not come to pass within {within:g} s of the lab's time; what is: {self.look()}"
                )
            time.sleep(POLL_S)

    def stop_poses(self) -> None:
        """Motion capture is lost: no drone gets a pose any more."""
        self._running = False
        self._pose()

    def resume_poses(self) -> None:
        """Motion capture is back."""
        self._running = True
        self._pose()

    def shift_poses(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> None:
        """From now on motion capture sees every drone beside where it is, m."""
        self._shift = (number("x", x), number("y", y), number("z", z))
        self._pose()

    def turn_poses(self, degrees: float) -> None:
        """From now on motion capture sees every drone turned about the vertical."""
        self._turn = math.radians(number("degrees", degrees))
        self._pose()

    def _pose(self) -> None:
        change = {"running": self._running, "shift": self._shift, "turn": self._turn}
        self.note("poses", **change)
        self.ask("poses", **change)

    def note(self, event: str, **values: object) -> None:
        """Write a line into the events of this lab's record."""
        with (self.folder / EVENTS_FILE).open("a", encoding="utf-8") as file:
            file.write(json.dumps({"t": self.time, "event": event, **values}) + "\n")

    def look(self) -> dict[str, Any]:
        """Everything that is true now: ``t``, ``dropped``, ``drones``."""
        return self.ask("look")

    def ask(self, do: str, **values: object) -> dict[str, Any]:
        """One command to the lab's process."""
        return self._stage.ask(do, **values)

    def close(self) -> None:
        """End this lab; its record is complete then."""
        self.ask("close")
