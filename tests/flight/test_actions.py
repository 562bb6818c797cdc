"""Orders have identity: urgent ones wait behind nobody, older ones undo nothing, every end is heard of."""

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from onboard.link import DroneLink
from onboard.link.strays import COMMAND_LIFETIME_S
from onboard.timebase import WALL, Queue, WallTime
from perchhw.flight.actions import CommandRunner
from perchhw.supervisor import CommandDone, CommandFailed, Order
from perchhw.supervisor.events import Arm, Disarm, GoTo, Land, TakeOff
from tests.link.tiny_drone import TinyDrone
from tests.patience import StandingClock

WITHIN = 5.0


class Gate:
    """A link that notes its calls; `arm` and `go_to` block until they are let go."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.watched_from_the_start = False
        self.entered, self.let_go = threading.Event(), threading.Event()

    def _block(self, name: str) -> None:
        self.calls.append(name)
        self.entered.set()
        assert self.let_go.wait(WITHIN)
        self.calls.append(f"{name} ended")

    def kick_emergency_stop_watchdog(self) -> None:
        """Does not."""
        self.watched_from_the_start = not self.calls

    def arm(self) -> None:
        """Blocks."""
        self._block("arm")

    def go_to(self, *_: float, **_wanted: object) -> None:
        """Blocks."""
        self._block("go_to")

    def takeoff(self, *_: float, **_wanted: object) -> None:
        """Does not."""
        self.calls.append("takeoff")

    def land(self, *_: float, again: bool = False, **_wanted: object) -> None:
        """Does not."""
        self.calls.append("land again" if again else "land")

    def stop_motors(self) -> None:
        """Does not."""

    def disarm(self) -> None:
        """Does not."""
        self.calls.append("disarm")


def until(condition: Any, within: float = WITHIN) -> None:
    """Wait for a condition."""
    deadline = time.monotonic() + within
    while not condition():
        assert time.monotonic() < deadline, "it did not come to pass"
        threading.Event().wait(0.002)


@pytest.fixture
def gate() -> Gate:
    """A link with a gate."""
    return Gate()


@pytest.fixture
def clock() -> StandingClock:
    """What the runner reads; it waits by the machine's."""
    return StandingClock()


@pytest.fixture
def events() -> Queue:
    """What comes of its orders."""
    return WALL.queue()


@pytest.fixture
def runner(gate: Gate, events: Queue, clock: StandingClock) -> Iterator[CommandRunner]:
    """A runner on it, closed at the end."""
    link: Any = gate
    runner = CommandRunner(link, events, WallTime(clock))
    yield runner
    gate.let_go.set()
    runner.close()


def test_a_programming_error_is_a_failed_command() -> None:
    events = WALL.queue()
    no_link: Any = None
    runner = CommandRunner(no_link, events, WALL)
    try:
        runner.submit(Order(1, Arm()))
        event = events.get(timeout=5.0)
    finally:
        runner.close()
    assert isinstance(event, CommandFailed)
    assert event.order == Order(1, Arm())
    assert "AttributeError" in event.reason


def test_the_watchdog_runs_before_the_drone_is_armed(gate: Gate, runner: CommandRunner) -> None:
    """Whoever dies between the two must not leave an armed drone that nobody watches."""
    runner.submit(Order(1, Arm()))
    assert gate.entered.wait(WITHIN)
    assert gate.watched_from_the_start
    gate.let_go.set()


def test_a_disarming_is_not_lost_behind_an_arming_and_has_the_last_word(
    gate: Gate, runner: CommandRunner
) -> None:
    runner.submit(Order(1, Arm()))
    assert gate.entered.wait(WITHIN)
    runner.retire(2)
    runner.submit(Order(2, Disarm()))
    until(lambda: gate.calls == ["arm", "disarm"])
    gate.let_go.set()
    until(lambda: gate.calls == ["arm", "disarm", "arm ended", "disarm"])


def test_closing_does_not_cancel_a_disarming(gate: Gate, runner: CommandRunner) -> None:
    runner.submit(Order(1, Arm()))
    assert gate.entered.wait(WITHIN)
    runner.retire(2)
    runner.submit(Order(2, Disarm()))
    gate.let_go.set()
    runner.close()
    assert gate.calls[-1] == "disarm"


def test_orders_that_were_taken_back_are_dropped_where_they_wait(gate: Gate, runner: CommandRunner) -> None:
    runner.submit(Order(1, GoTo((0.0, 0.0, 1.0), 1.0)))
    assert gate.entered.wait(WITHIN)
    runner.submit(Order(2, TakeOff(1.0, 1.0)))
    runner.retire(3)
    runner.submit(Order(3, TakeOff(2.0, 1.0)))
    gate.let_go.set()
    until(lambda: gate.calls == ["go_to", "go_to ended", "takeoff"])


def test_a_landing_is_ordered_again_when_the_go_to_that_it_overtook_has_ended(
    gate: Gate, runner: CommandRunner
) -> None:
    runner.submit(Order(1, GoTo((0.0, 0.0, 1.0), 1.0)))
    assert gate.entered.wait(WITHIN)
    runner.retire(2)
    runner.submit(Order(2, Land(3.0)))
    until(lambda: gate.calls == ["go_to", "land"])
    gate.let_go.set()
    until(lambda: gate.calls == ["go_to", "land", "go_to ended", "land again"])


def test_a_landing_is_ordered_again_while_copies_of_a_go_to_may_be_under_way(
    gate: Gate, runner: CommandRunner
) -> None:
    gate.let_go.set()
    runner.submit(Order(1, GoTo((0.0, 0.0, 1.0), 1.0)))
    until(lambda: gate.calls == ["go_to", "go_to ended"])
    begin = time.monotonic()
    runner.submit(Order(2, Land(3.0)))
    until(lambda: gate.calls[2:] == ["land", "land again"])
    assert time.monotonic() - begin >= COMMAND_LIFETIME_S


@pytest.mark.parametrize("why", ["old", "overtook another", "taken back", "closed"])
def test_a_landing_is_ordered_once_where_nothing_can_undo_it(
    gate: Gate, runner: CommandRunner, events: Queue, clock: StandingClock, why: str
) -> None:
    first = Arm() if why == "overtook another" else GoTo((0.0, 0.0, 1.0), 1.0)
    runner.submit(Order(1, first))
    assert gate.entered.wait(WITHIN)
    if why == "old":
        gate.let_go.set()
        assert isinstance(events.get(timeout=WITHIN), CommandDone)
        clock.now += 1.1 * COMMAND_LIFETIME_S
    runner.submit(Order(2, Land(3.0)))
    until(lambda: "land" in gate.calls)
    gate.let_go.set()
    if why == "taken back":
        runner.retire(3)
    if why == "closed":
        runner.close()
    threading.Event().wait(2.0 * COMMAND_LIFETIME_S)
    assert "land again" not in gate.calls


def test_answers_name_their_order(gate: Gate) -> None:
    link: Any = gate
    events = WALL.queue()
    runner = CommandRunner(link, events, WALL)
    gate.let_go.set()
    orders = [Order(1, GoTo((0.0, 0.0, 1.0), 1.0)), Order(2, TakeOff(1.0, 1.0))]
    for order in orders:
        runner.submit(order)
    answers = [events.get(timeout=WITHIN) for _ in orders]
    runner.close()
    assert answers == [CommandDone(order) for order in orders]


@pytest.mark.parametrize("close_at_once", [False, True])
def test_a_stop_does_not_wait_behind_a_landing_that_gets_no_answer(close_at_once: bool) -> None:
    """On a flight's runner and link: a landing blocked it until its time was up, and closing cancelled it."""
    for delay in (0.0, 0.0005, 0.002, 0.01, 0.05):
        with TinyDrone() as tiny, DroneLink.open(tiny.uri, reply_timeout_s=20.0) as link:
            tiny.drop = lambda request: request[0] & 0xF3 == 0x80
            runner = CommandRunner(link, WALL.queue(), WALL)
            runner.submit(Order(1, Land(3.0)))
            threading.Event().wait(delay)
            begin = time.monotonic()
            link.stop_path.trigger()
            if close_at_once:
                link.close()
            until(lambda: tiny.supervisor_bits & 0x40)
            assert time.monotonic() - begin < 10.0  # half of what the landing would wait
            link.close()
            runner.close()
