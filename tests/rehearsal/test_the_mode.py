"""Rehearsal mode on the drone: when it is taken, that nothing turns, how it ends."""

from collections.abc import Callable

import pytest

from onboard.app_interface import EndReason, LandingState, Parameter, Rehearsal
from onboard.firmware.compiler import find_compiler
from sim_backend.engine_name import EngineName
from tests.rehearsal.desk import PLAN, Desk
from tests.sim_crazyflie.simulated_flight import ENGINES, Flight

EACH_KIND = pytest.mark.parametrize("kind", [Rehearsal.POSES, Rehearsal.MODEL])
SWITCHES = (Parameter.REHEARSE, Parameter.TRAJECTORY_ARM, Parameter.POLICY_ARM, Parameter.GO)


@pytest.fixture(autouse=True, params=ENGINES[:2])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> EngineName:
    engine = EngineName(request.param)
    if engine is EngineName.C and find_compiler() is None:
        pytest.skip("no C compiler: the drone's code in C cannot rehearse")
    monkeypatch.setattr(Flight, "engine", engine)
    return engine


@EACH_KIND
def test_an_approach_is_computed_to_its_flip_and_no_motor_turns(kind: Rehearsal) -> None:
    desk = Desk(kind=kind)
    ring = desk.rehearse()
    assert desk.flight.log("perch.reason") == EndReason.TRIGGERED
    at = ring.ticks.tolist().index(ring.end_tick)
    assert ring.periods["trigger_value"][at] >= 0.0 > ring.periods["trigger_value"][at - 1]
    assert ring.periods["law"]["thrusts"][at, 0].max() > 0.05, "the flip is computed"
    assert desk.most_thrust == 0.0
    assert desk.flight.position[2] < 0.1


@EACH_KIND
def test_the_drone_cannot_be_armed_meanwhile(kind: Rehearsal) -> None:
    desk = Desk(kind=kind)
    assert desk.flight.firmware.supervisor.arm(True)
    assert desk.flight.firmware.supervisor.arm(False)
    desk.flight.run(0.2)
    assert desk.begin()
    assert not desk.flight.firmware.supervisor.arm(True)
    desk.flight.write(Parameter.REHEARSE, 0)
    desk.flight.run(0.1)
    assert desk.flight.firmware.supervisor.arm(True)


def armed(desk: Desk) -> None:
    desk.flight.arm()


def flying(desk: Desk) -> None:
    desk.flight.poses = True
    desk.flight.hover(0.5)


def motor_on(desk: Desk) -> None:
    desk.flight.write("motorPowerSet.m1", 9000)
    desk.flight.write("motorPowerSet.enable", 1)
    desk.flight.run(0.1)


def idling(desk: Desk) -> None:
    desk.flight.write("powerDist.idleThrust", 7000)


def with_another_estimator(desk: Desk) -> None:
    desk.flight.write("stabilizer.estimator", 1)


@EACH_KIND
@pytest.mark.parametrize("unfit", [armed, flying, motor_on, idling, with_another_estimator])
def test_the_mode_is_not_taken(unfit: Callable[[Desk], None], kind: Rehearsal) -> None:
    desk = Desk(kind=kind)
    unfit(desk)
    before = desk.flight.firmware.ratios.any()
    assert not desk.begin()
    desk.flight.run(0.05)
    assert desk.flight.param(Parameter.REHEARSE) == 0
    assert desk.flight.firmware.ratios.any() == before, "who flies goes on"


@EACH_KIND
@pytest.mark.parametrize("seconds", [0.0, 0.7, 1.5])
def test_a_thrust_that_is_seen_ends_it_and_everything_armed(seconds: float, kind: Rehearsal) -> None:
    desk = Desk(kind=kind)
    desk.arm()
    desk.flight.write(Parameter.GO, 1)
    desk.send(seconds, moving=True)
    motor_on(desk)
    assert [desk.flight.param(name) for name in SWITCHES] == [0] * len(SWITCHES)
    assert desk.state() is LandingState.IDLE


@EACH_KIND
def test_what_a_rehearsal_left_does_not_fly(kind: Rehearsal) -> None:
    """Switched off in a hold under the ceiling: the next flight is the planner's alone."""
    desk = Desk(kind=kind)
    desk.arm()
    desk.flight.write(Parameter.GO, 1)
    desk.send(0.8, moving=True)
    desk.flight.write(Parameter.ABORT, 1)
    desk.send(0.5)
    assert desk.state() in (LandingState.BRAKE, LandingState.HOLD)
    desk.flight.write(Parameter.REHEARSE, 0)
    desk.flight.run(0.05)
    assert desk.state() is LandingState.IDLE
    desk.flight.write("kalman.resetEstimation", 1)
    desk.flight.poses = True
    desk.flight.hover(0.5)
    assert desk.flight.position[2] == pytest.approx(0.5, abs=0.1)
    assert abs(desk.flight.position[0] - PLAN.x0) > 0.3


def test_writing_the_mode_in_flight_stops_no_motor() -> None:
    desk = Desk()
    flying(desk)
    desk.flight.post(Parameter.REHEARSE, 1)
    for _ in range(20):
        desk.flight.tick()
        assert desk.flight.firmware.ratios.min() > 0
