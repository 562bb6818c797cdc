"""Every setting of the drone that could harm a flight is read back before it is armed."""

from typing import Any, cast

import pytest

from onboard.link.errors import LinkTimeout, NoSuchVariable
from onboard.timebase import WALL
from perchhw.flight.actions import LandingCommands
from perchhw.flight.mission import AttemptPlan
from perchhw.flight.readback import LANDING_SETTINGS, OWN_LAW, TEST_FLIGHT_SETTINGS, ReadBack
from perchhw.supervisor import CommandDone, CommandFailed, Order
from perchhw.supervisor.events import UploadPolicy

WITHIN = 30.0

GOOD = {
    "stabilizer.controller": 6,
    "stabilizer.estimator": 2,
    "powerDist.idleThrust": 0,
    "motorPowerSet.enable": 0,
    "perch.ownLaw": 1,
}
COMMON = ("stabilizer.estimator", "powerDist.idleThrust", "motorPowerSet.enable")
NEEDED = {
    "test flight": (TEST_FLIGHT_SETTINGS, COMMON),
    "landing": (LANDING_SETTINGS, ("stabilizer.controller", *COMMON)),
    "landing by our law": ({**LANDING_SETTINGS, **OWN_LAW}, tuple(GOOD)),
}
CASES = [(kind, name) for kind, (_, names) in NEEDED.items() for name in names]


class Drone:
    """Answers with these values, or raises them; takes every policy."""

    def __init__(self, **wrong: float | Exception) -> None:
        self.values: dict[str, float | Exception] = {**GOOD, **wrong}

    def param(self, name: str) -> float:
        """As the link's."""
        value = self.values[name]
        if isinstance(value, Exception):
            raise value
        return value

    def upload_policy(self, bundle: bytes) -> int:
        """The CRC that is then live."""
        return len(bundle)


def checked(kind: str, **wrong: float | Exception) -> ReadBack:
    """What is known after the drone was asked."""
    link: Any = Drone(**wrong)
    readback = ReadBack()
    readback.check_settings(link, NEEDED[kind][0])
    return readback


@pytest.mark.parametrize("kind", NEEDED)
def test_a_drone_that_is_set_as_needed_passes(kind: str) -> None:
    assert ReadBack().parameters_ok is None, "before it was asked nothing is known"
    readback = checked(kind)
    assert readback.parameters_ok is True
    assert readback.parameters_problem is None


@pytest.mark.parametrize(("kind", "name"), CASES)
def test_one_wrong_setting_is_refused_by_name(kind: str, name: str) -> None:
    for other in (GOOD[name] + 1, float("nan")):
        readback = checked(kind, **{name: other})
        assert readback.parameters_ok is False
        assert readback.parameters_problem == f"{name} is {other:g}, need {GOOD[name]}"


@pytest.mark.parametrize(("kind", "name"), CASES)
@pytest.mark.parametrize("error", [LinkTimeout("silent"), NoSuchVariable("not there")])
def test_a_setting_that_is_not_answered_is_refused(kind: str, name: str, error: Exception) -> None:
    readback = checked(kind, **{name: error})
    assert readback.parameters_ok is False
    assert readback.parameters_problem == f"{name} is not known: {error}"


def test_all_that_is_wrong_is_told_at_once() -> None:
    readback = checked("landing", **dict.fromkeys(NEEDED["landing"][1], 9))
    readback.refuse("another vehicle")
    assert readback.parameters_problem is not None
    assert len(readback.parameters_problem.split("; ")) == 5


@pytest.mark.parametrize("name", NEEDED["landing"][1])
@pytest.mark.parametrize("then", [9, LinkTimeout("silent")])
def test_a_setting_that_somebody_changes_meanwhile_is_seen_before_the_drone_is_armed(
    name: str, then: float | Exception
) -> None:
    drone = Drone()
    link: Any = drone
    readback, events, no_plan = ReadBack(), WALL.queue(), cast(AttemptPlan, None)
    readback.check_settings(link, LANDING_SETTINGS)
    runner = LandingCommands(link, events, WALL, readback, no_plan, b"12345", None)
    try:
        runner.submit(Order(1, UploadPolicy()))
        assert events.get(timeout=WITHIN) == CommandDone(Order(1, UploadPolicy()), 5)
        drone.values[name] = then
        runner.submit(Order(2, UploadPolicy()))
        answer = events.get(timeout=WITHIN)
    finally:
        runner.close()
    assert isinstance(answer, CommandFailed)
    assert answer.reason.startswith(f"parameters: {name} is ")
    assert readback.parameters_ok is False


def test_settings_that_nobody_has_named_are_not_known_by_asking_again() -> None:
    link: Any = Drone()
    readback = ReadBack()
    readback.check_again(link)
    assert readback.parameters_ok is None
