"""Whatever goes wrong while a command is carried out, the supervisor hears of it."""

from typing import Any

from onboard.timebase import WALL
from perchhw.flight.actions import CommandRunner
from perchhw.supervisor import CommandFailed, Order
from perchhw.supervisor.events import Arm


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
