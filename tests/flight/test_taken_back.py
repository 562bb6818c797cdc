"""An order to arm the approach that is taken back sets no switch; a brake switches the policy off."""

from collections.abc import Callable, Mapping
from typing import Any

import pytest

from onboard.app_interface import Parameter, TrajectoryStatus
from onboard.link.errors import LinkTimeout
from onboard.room import RoomGeometry
from onboard.timebase import WALL, Queue
from onboard.trajectory import fit_approach
from perchhw.flight.actions import LandingCommands
from perchhw.flight.mission import AttemptPlan
from perchhw.flight.readback import ReadBack
from perchhw.supervisor import CommandDone, CommandFailed, Mission, Order
from perchhw.supervisor.events import ArmApproach, Brake, Command, DisarmPolicy

WITHIN = 30.0
SWITCHES = [Parameter.TRAJECTORY_ARM, Parameter.POLICY_ARM]


class App:
    """The drone's landing app, and what happens when it is told something."""

    def __init__(self) -> None:
        self.values: dict[str, float] = {}
        self.written: list[str] = []
        self.when_written: Callable[[str], None] = lambda _name: None

    def set_params(self, values: Mapping[str, float]) -> None:
        """One after the other."""
        for name, value in values.items():
            self.set_param(name, value)

    def set_param(self, name: str, value: float) -> None:
        """Note it."""
        self.values[name] = value
        self.written.append(name)
        self.when_written(name)

    def param(self, name: str) -> float:
        """It takes every approach."""
        if name == Parameter.TRAJECTORY_STATUS:
            return TrajectoryStatus.ARMED
        return self.values.get(name, 0)


def runner_of(app: App, readback: ReadBack, events: Queue) -> LandingCommands:
    link: Any = app
    approach = fit_approach(2.5, 60.0, RoomGeometry())
    mission = Mission(policy_crc=0, start=(0.0, 0.0, 1.0), hover_height=1.0, approach_duration=1.0)
    plan = AttemptPlan(approach=approach, mission=mission)
    return LandingCommands(link, events, WALL, readback, plan, b"", None)


def arm(taken_back_at: str | None) -> tuple[App, CommandDone | CommandFailed, ReadBack]:
    """What comes of the order, which is taken back when the app is told `taken_back_at`."""
    app, readback, events = App(), ReadBack(), WALL.queue()
    runner = runner_of(app, readback, events)
    app.when_written = lambda name: runner.retire(2) if name == taken_back_at else None
    try:
        runner.submit(Order(1, ArmApproach()))
        answer = events.get(timeout=WITHIN)
    finally:
        runner.close()
    return app, answer, readback


def test_one_that_stays_in_force_sets_both() -> None:
    app, answer, readback = arm(None)
    assert isinstance(answer, CommandDone)
    assert app.written[-2:] == SWITCHES
    assert (readback.trajectory_armed, readback.policy_armed) == (True, True)


@pytest.mark.parametrize(
    ("at", "switches"), [(Parameter.CEILING_Z, 0), (Parameter.TAU_START, 0), (Parameter.TRAJECTORY_ARM, 1)]
)
def test_one_that_is_taken_back_sets_none_from_there_on(at: str, switches: int) -> None:
    app, answer, readback = arm(at)
    assert isinstance(answer, CommandFailed)
    assert answer.order == Order(1, ArmApproach())
    assert "taken back" in answer.reason
    assert [name for name in app.written if name in SWITCHES] == SWITCHES[:switches]
    assert (readback.trajectory_armed, readback.policy_armed) == (None, None), "nothing is known of them"


# --- a brake ----------------------------------------------------------------------------------------------

BRAKES: list[tuple[Command, list[str]]] = [(Brake(), [Parameter.ABORT]), (DisarmPolicy(), [])]


def brake(command: Command, app: App) -> tuple[CommandDone | CommandFailed, ReadBack]:
    """What comes of `command` when approach and policy are armed."""
    readback, events = ReadBack(), WALL.queue()
    readback.switches_are(True)
    runner = runner_of(app, readback, events)
    try:
        runner.submit(Order(1, command))
        answer = events.get(timeout=WITHIN)
    finally:
        runner.close()
    return answer, readback


@pytest.mark.parametrize(("command", "first"), BRAKES)
def test_a_brake_switches_the_policy_off_and_leaves_the_hand_over_to_the_landing(
    command: Command, first: list[str]
) -> None:
    app = App()
    answer, readback = brake(command, app)
    assert isinstance(answer, CommandDone)
    assert app.written == [*first, Parameter.POLICY_ARM]
    assert app.values[Parameter.POLICY_ARM] == 0
    assert (readback.policy_armed, readback.trajectory_armed) == (False, True)


@pytest.mark.parametrize(("command", "first"), BRAKES)
@pytest.mark.parametrize("refused", [True, False])
def test_a_brake_is_not_given_up_for_a_policy_that_stays_on(
    command: Command, first: list[str], refused: bool
) -> None:
    """A failed order would be a stop, in the air."""
    app = App()

    def does_not_obey(name: str) -> None:
        if name == Parameter.POLICY_ARM:
            app.values[name] = 1
            if not refused:
                raise LinkTimeout("no answer")

    app.when_written = does_not_obey
    answer, readback = brake(command, app)
    assert isinstance(answer, CommandDone)
    assert app.written == [*first, Parameter.POLICY_ARM]
    assert readback.policy_armed is True, "which the supervisor tells"


def test_a_brake_that_is_not_taken_is_a_failure() -> None:
    app = App()

    def lost(name: str) -> None:
        if name == Parameter.ABORT:
            raise LinkTimeout("no answer")

    app.when_written = lost
    answer, _ = brake(Brake(), app)
    assert isinstance(answer, CommandFailed)
    assert app.written == [Parameter.ABORT]
