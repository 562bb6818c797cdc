"""The host's side of the dialogue with the landing app, over a socket, with the simulated drone behind it."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event

import pytest

from onboard.app_interface import LandingState, Parameter, PolicyStatus, TrajectoryStatus
from onboard.clock import monotonic
from onboard.firmware.constants import vehicle_crc32
from onboard.link import CommandRefused, DroneLink, LinkTimeout, NoSuchVariable
from onboard.link.landing_app import arm_approach, check_vehicle, disarm_policy, release
from onboard.policy.bundle import encode_bundle
from onboard.room import RoomGeometry
from onboard.timebase import WallTime
from onboard.trajectory import ApproachPlan, fit_approach
from onboard.vehicle import load_vehicle
from perchhw.walkthrough.gap.story import BELIEVED, hidden_vehicle
from tests.link.tiny_drone import TinyDrone
from tests.patience import patient_link
from tests.sim_crazyflie.served_flight import ServedFlight, serve_flight
from tests.sim_crazyflie.simulated_flight import LEGS, VEHICLE, Flight
from tests.sim_crazyflie.small_policy import small_policy

PLAN = fit_approach(2.5, 60.0, RoomGeometry())
BUNDLE = encode_bundle(small_policy())


@contextmanager
def flown(flight: Flight) -> Iterator[tuple[ServedFlight, DroneLink]]:
    with serve_flight(flight) as served, patient_link(served.uri) as link:
        yield served, link


def lab_time(served: ServedFlight) -> WallTime:
    """Deadlines count in the drone's time: a machine that is busy makes nothing late."""
    return WallTime(lambda: served.flight.world.time)


def at_the_start(policy: bytes | None = BUNDLE) -> Flight:
    flight = Flight(seed=1)
    if policy is not None:
        assert flight.upload(policy) == PolicyStatus.ACTIVE
    flight.fly_to_start(PLAN)
    return flight


def until(served: ServedFlight, holds: Callable[[], bool], within: float = 10.0) -> None:
    """Wait at most `within` s of the drone's time."""
    deadline, pause = served.flight.world.time + within, Event()
    while not holds():
        assert served.flight.world.time < deadline
        pause.wait(0.01)


def in_state(served: ServedFlight, state: LandingState) -> Callable[[], bool]:
    return lambda: served.call(lambda: served.flight.log("perch.state")) == state


def test_an_approach_is_armed_and_flown() -> None:
    with flown(at_the_start()) as (served, link):
        arm_approach(link, PLAN, lab_time(served))
        assert link.param(Parameter.TRAJECTORY_STATUS) == TrajectoryStatus.ARMED
        assert (link.param(Parameter.TRAJECTORY_ARM), link.param(Parameter.POLICY_ARM)) == (1, 1)
        link.set_param(Parameter.GO, 1)
        until(served, in_state(served, LandingState.CUT))
        assert served.call(lambda: served.flight.log("perchT.count")) == 1


@pytest.mark.parametrize(
    ("plan", "reason"),
    [
        (PLAN._replace(impact_x=PLAN.impact_x + 1.0), "too far from the approach's start"),
        (PLAN._replace(tau0=0.0), "no sound approach"),
    ],
)
def test_a_refused_approach_says_why_and_nothing_is_armed(plan: ApproachPlan, reason: str) -> None:
    with flown(at_the_start()) as (served, link):
        with pytest.raises(CommandRefused, match=reason):
            arm_approach(link, plan, lab_time(served))
        assert link.param(Parameter.POLICY_ARM) == 0
        assert in_state(served, LandingState.IDLE)()


def test_a_policy_that_is_not_there_is_noticed_by_reading_back() -> None:
    with flown(at_the_start(policy=None)) as (served, link):
        with pytest.raises(CommandRefused, match=r"switch the policy on: perch\.polArm reads off"):
            arm_approach(link, PLAN, lab_time(served))
        assert release(link, lab_time(served)) is LandingState.IDLE


def test_a_drone_on_the_ground_is_not_armed_for_an_approach() -> None:
    with (
        flown(Flight()) as (served, link),
        pytest.raises(CommandRefused, match="the drone does not fly"),
    ):
        arm_approach(link, PLAN, lab_time(served))


def test_release_in_the_approach_returns_when_the_drone_is_handed_over_and_land_lands() -> None:
    with flown(at_the_start()) as (served, link):
        arm_approach(link, PLAN, lab_time(served))
        link.set_param(Parameter.GO, 1)
        until(served, in_state(served, LandingState.APPROACH))
        until(served, lambda: served.call(lambda: served.flight.drone.state["velocity"][0]) > 0.8)
        assert release(link, lab_time(served)) is LandingState.IDLE
        assert in_state(served, LandingState.IDLE)()
        assert (link.param(Parameter.TRAJECTORY_ARM), link.param(Parameter.POLICY_ARM)) == (0, 0)
        here = served.call(lambda: served.flight.position)
        link.land(0.0, 2.0)
        until(served, lambda: served.call(lambda: served.flight.position[2]) < 0.1)
        there = served.call(lambda: served.flight.position)
        assert there[0] == pytest.approx(here[0], abs=0.4), "down from where it was, not from the old goal"


def test_a_policy_that_is_switched_off_in_a_brake_leaves_the_drone_with_the_app() -> None:
    with flown(at_the_start()) as (served, link):
        arm_approach(link, PLAN, lab_time(served))
        link.set_param(Parameter.GO, 1)
        until(served, in_state(served, LandingState.APPROACH))
        link.set_param(Parameter.ABORT, 1)
        disarm_policy(link)
        until(served, in_state(served, LandingState.HOLD))
        assert (link.param(Parameter.TRAJECTORY_ARM), link.param(Parameter.POLICY_ARM)) == (1, 0)
        assert release(link, lab_time(served)) is LandingState.IDLE


def test_release_of_a_drone_whose_motors_are_off_does_not_wait() -> None:
    with flown(at_the_start()) as (served, link):
        arm_approach(link, PLAN, lab_time(served))
        link.set_param(Parameter.GO, 1)
        until(served, in_state(served, LandingState.CUT))
        begin = served.flight.world.time
        assert release(link, lab_time(served)) is LandingState.CUT
        assert served.flight.world.time - begin < 1.0


def test_the_vehicle_must_be_the_one_that_is_flashed() -> None:
    true, flashed = load_vehicle(VEHICLE, LEGS), load_vehicle("crazyflie21-stock")
    with flown(Flight(flashed=flashed)) as (_, link):
        check_vehicle(link, vehicle_crc32(flashed), flashed.name)
        numbers = f"{vehicle_crc32(flashed):08x}, those of {true.name} have {vehicle_crc32(true):08x}"
        with pytest.raises(CommandRefused, match=re.escape(numbers)) as refusal:
            check_vehicle(link, vehicle_crc32(true), true.name)
        assert f"flash the firmware built for {true.name}, or name the vehicle that is flashed" in str(
            refusal.value
        )


def test_what_the_walkthrough_hides_is_not_what_is_flashed() -> None:
    assert vehicle_crc32(hidden_vehicle()) == vehicle_crc32(load_vehicle(BELIEVED))


# What the simulated drone never does is played by a tiny one.


def test_no_verdict_is_a_timeout_at_the_deadline(tiny: TinyDrone, link: DroneLink) -> None:
    begin = monotonic()
    with pytest.raises(LinkTimeout, match=r"did not say within 0\.2 s"):
        arm_approach(link, PLAN, within=0.2)
    assert monotonic() - begin >= 0.2
    assert tiny.values["perch.polArm"] == 0


def test_the_deadline_is_that_of_the_clock_that_is_given(tiny: TinyDrone, link: DroneLink) -> None:
    now = iter([0.0, 10.0])
    with pytest.raises(LinkTimeout):
        arm_approach(link, PLAN, WallTime(lambda: next(now)), within=5.0)


def test_an_unknown_verdict_is_a_refusal(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.values["perch.trjStat"] = 99
    with pytest.raises(CommandRefused, match="status 99, unknown"):
        arm_approach(link, PLAN)
    assert tiny.values["perch.polArm"] == 0


@pytest.mark.parametrize("state", [LandingState.APPROACH, LandingState.BRAKE, LandingState.HOLD])
def test_an_app_that_keeps_the_drone_is_an_error(
    tiny: TinyDrone, link: DroneLink, state: LandingState
) -> None:
    tiny.values["perch.state"] = int(state)
    tiny.values["perch.trjArm"] = tiny.values["perch.polArm"] = 1
    with pytest.raises(CommandRefused, match=f"did not hand the drone over within 0.1 s.*{state.name}"):
        release(link, within=0.1)
    assert (tiny.values["perch.trjArm"], tiny.values["perch.polArm"]) == (0, 0)


def test_an_unknown_state_does_not_hold_up_a_landing(tiny: TinyDrone, link: DroneLink) -> None:
    tiny.values["perch.state"] = 200
    assert release(link, within=0.1) is None


def test_a_vehicle_is_asked_of_no_other_version(tiny: TinyDrone, link: DroneLink) -> None:
    check_vehicle(link, 0x1234, "v")
    tiny.values["perch.version"] = 1
    with pytest.raises(NoSuchVariable, match="version 1, needed is 2"):
        check_vehicle(link, 0x1234, "v")
