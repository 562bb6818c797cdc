"""A landing that is ordered while an older command is still under way is not undone by it.

The planner takes a GoTo also when it lands, and a drone that hovers at the landing's deadline is stopped
there.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from onboard.arrays import Vector
from onboard.link import DroneLink, LogSample
from onboard.timebase import WALL
from perchhw.flight.actions import CommandRunner, LandingCommands
from perchhw.flight.course_commands import CourseCommands
from perchhw.flight.readback import ReadBack
from perchhw.lab_process import SimulatedLab
from perchhw.supervisor import Order
from perchhw.supervisor.events import FlyCourse, GoTo, Land, TakeOff
from perchhw.supervisor.state import Timing
from tests.link.faulty_network import Faults, FaultyNetwork
from tests.patience import patient_link, until

HOVER, ASIDE = 0.6, 1.5
GO_TO, PLANNER, SETPOINT = b"\x0c", 0x80, 0x70
DEADLINE_MS = 1000.0 * (Timing().land + Timing().land_margin)
LOST_S, DOUBLED_S = 10.0, 0.3
SOFT = 1.5
"""m/s; a drone whose motors stop in the hover falls with more."""


@pytest.fixture(scope="module")
def network() -> Iterator[FaultyNetwork]:
    """A network to a drone that knows where it is."""
    with (
        SimulatedLab("drone", ("--drone-port", "0", "--feed-poses")) as lab,
        FaultyNetwork(int(lab.drones[0].rpartition(":")[2]), np.random.default_rng(3), Faults()) as network,
    ):
        yield network


class Flown:
    """A drone that hovers, and what it says of itself."""

    def __init__(self, link: DroneLink) -> None:
        self.link = link
        self.latest: LogSample | None = None
        self.fastest_fall = 0.0
        link.stream(("stateEstimate.z", "stateEstimate.vz"), 10, self._note)
        link.arm()
        until(lambda: link.supervisor_info().can_fly)

    def _note(self, sample: LogSample) -> None:
        self.latest = sample
        self.fastest_fall = max(self.fastest_fall, -sample.values["stateEstimate.vz"])

    @property
    def height(self) -> float:
        """m; that of a drone of which nothing is known is none."""
        return float("nan") if self.latest is None else self.latest.values["stateEstimate.z"]

    @property
    def time_ms(self) -> float:
        """The drone's own."""
        return float("nan") if self.latest is None else self.latest.drone_time_ms

    def height_at(self, time_ms: float) -> float:
        """How high it is when so much time of its own has passed, m."""
        until(lambda: self.time_ms >= time_ms)
        return self.height


def of_planner(packet: bytes, command: bytes) -> bool:
    """Whether a packet, either way, is this command of the planner."""
    return packet[0] & 0xF3 == PLANNER and packet[1:2] == command


class Standing:
    """A course that stays where it is for a second."""

    duration = 1.0

    def index_at(self, _elapsed: float) -> int:
        """Any."""
        return 0

    def setpoint(self, _index: int) -> tuple[Vector, Vector, Vector, float, float]:
        """In the hover."""
        return (0.0, 0.0, HOVER), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0


def plain(link: DroneLink) -> CommandRunner:
    """The commands that every flight has."""
    return CommandRunner(link, WALL.queue(), WALL)


def of_a_landing(link: DroneLink) -> CommandRunner:
    """A landing's."""
    plan: Any = None
    return LandingCommands(link, WALL.queue(), WALL, ReadBack(), plan, b"", None)


def of_a_course(link: DroneLink) -> CommandRunner:
    """A test flight's."""
    course: Any = Standing()
    return CourseCommands(link, WALL.queue(), WALL, course)


@contextmanager
def hovering(
    network: FaultyNetwork, commands: Callable[[DroneLink], CommandRunner]
) -> Iterator[tuple[Flown, CommandRunner]]:
    """A drone at the height of its hover, and the runner of its flight's commands."""
    network.drop_replies, network.again_after = (lambda _packet: False), (lambda _packet: None)
    with patient_link(network.uri, reply_timeout_s=LOST_S) as link:
        until(lambda: link.supervisor_info().can_arm)
        flown, runner = Flown(link), commands(link)
        try:
            runner.submit(Order(1, TakeOff(HOVER, 1.0)))
            until(lambda: flown.height > HOVER - 0.05)
            yield flown, runner
        finally:
            runner.close()
            link.stop_motors()
            link.disarm()


def assert_lands(flown: Flown, runner: CommandRunner) -> None:
    """Ordered to land now, it stands on the floor at the supervisor's deadline, and did not fall."""
    ordered_ms = flown.time_ms
    runner.retire(3)
    runner.submit(Order(3, Land(Timing().land)))
    assert flown.height_at(ordered_ms + DEADLINE_MS) < 0.1
    assert flown.fastest_fall < SOFT


@pytest.mark.parametrize("commands", [plain, of_a_landing, of_a_course])
def test_a_go_to_without_an_answer_does_not_undo_a_landing(
    network: FaultyNetwork, commands: Callable[[DroneLink], CommandRunner]
) -> None:
    with hovering(network, commands) as (flown, runner):
        network.drop_replies = lambda packet: of_planner(packet, GO_TO)
        runner.submit(Order(2, GoTo((ASIDE, 0.0, HOVER), 2.0)))
        threading.Event().wait(0.05)
        assert_lands(flown, runner)


def test_a_copy_of_a_go_to_that_comes_behind_a_landing_does_not_undo_it(network: FaultyNetwork) -> None:
    """Its first copy was answered: nothing is running any more when the landing is ordered."""
    with hovering(network, plain) as (flown, runner):
        network.again_after = lambda packet: DOUBLED_S if of_planner(packet, GO_TO) else None
        runner.submit(Order(2, GoTo((ASIDE, 0.0, HOVER), 2.0)))
        until(lambda: network.doubled)
        threading.Event().wait(0.05)
        assert_lands(flown, runner)


def test_setpoints_of_a_course_that_come_behind_a_landing_do_not_undo_it(network: FaultyNetwork) -> None:
    """A setpoint overrules the planner; 2 s after the last one the drone's commander stops the motors."""
    with hovering(network, of_a_course) as (flown, runner):
        network.again_after = lambda packet: DOUBLED_S if packet[0] & 0xF3 == SETPOINT else None
        runner.submit(Order(2, FlyCourse()))
        until(lambda: network.doubled)
        threading.Event().wait(0.5)
        assert_lands(flown, runner)
