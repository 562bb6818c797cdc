"""Safety rules: default-deny, swept over their boundaries."""

from dataclasses import fields, replace
from math import degrees, inf, nan, nextafter, radians

import pytest

from mocap_bridge.health import PoseVerdict
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import Observation, SafetyLimits, Violation
from perchhw.supervisor.gate import GateMemory, admit
from perchhw.supervisor.observation import Admitted, Attitude
from perchhw.supervisor.rules import (
    APPROACH_RULES,
    HOVER_RULES,
    PREFLIGHT_RULES,
    TAKE_OFF_RULES,
    TEST_FLIGHT_RULES,
)
from perchhw.supervisor.violation import Rule, first_violation

from .simulated_attempt import FLYING, good_on_ground, turned

LIMITS = SafetyLimits()
NOT_GUARDED_ON_GROUND = {
    "pose_problem",
    "landing_state",
    "landing_age",
    "end_reason",
    "active_policy_crc",
    "trigger_count",
    "policy_crc_age",
    "policy_armed",
    "trajectory_armed",
    "parameters_problem",
    "rates_age",
    "body_rates",
}


def broken(rules: tuple[Rule, ...], o: Observation) -> Violation | None:
    """What the rules say of an observation that has passed the gate."""
    return first_violation(rules, admit(o, GateMemory(), LIMITS, 0.0)[0], LIMITS)


def good_in_flight() -> Observation:
    place = (-3.0, 0.0, 0.6)
    return replace(
        good_on_ground(),
        pose_position=place,
        estimate_position=place,
        drone=SupervisorInfo(FLYING),
        battery_voltage=3.4,
    )


def test_all_rules_hold_when_all_is_well() -> None:
    assert broken(PREFLIGHT_RULES, good_on_ground()) is None
    assert broken(HOVER_RULES, good_in_flight()) is None
    assert broken(APPROACH_RULES, good_in_flight()) is None


@pytest.mark.parametrize("name", [f.name for f in fields(Observation) if f.name not in NOT_GUARDED_ON_GROUND])
def test_an_unknown_value_never_arms(name: str) -> None:
    assert broken(PREFLIGHT_RULES, replace(good_on_ground(), **{name: None})) is not None


def test_knowing_nothing_never_flies() -> None:
    marked = replace(LIMITS, start_mark=(-3.0, 0.0, 0.0))
    for rules in (PREFLIGHT_RULES, TAKE_OFF_RULES, HOVER_RULES, TEST_FLIGHT_RULES, APPROACH_RULES):
        for rule in rules:
            assert rule(Admitted(Observation()), marked) is not None, rule.__name__


@pytest.mark.parametrize("verdict", [v for v in PoseVerdict if v is not PoseVerdict.OK])
def test_only_a_good_pose_arms(verdict: PoseVerdict) -> None:
    assert broken(PREFLIGHT_RULES, replace(good_on_ground(), pose_verdict=verdict)) is not None


@pytest.mark.parametrize("verdict", [None, PoseVerdict.UNKNOWN, PoseVerdict.LOST])
def test_lost_poses_end_a_flight(verdict: PoseVerdict | None) -> None:
    for rules in (HOVER_RULES, APPROACH_RULES):
        assert broken(rules, replace(good_in_flight(), pose_verdict=verdict)) is not None


@pytest.mark.parametrize(
    "verdict", [PoseVerdict.FROZEN, PoseVerdict.FLIPPED, PoseVerdict.STALE, PoseVerdict.OCCLUDED]
)
def test_rejected_poses_are_bridged_for_a_moment_and_no_longer(verdict: PoseVerdict) -> None:
    for rules in (HOVER_RULES, APPROACH_RULES):
        short = replace(good_in_flight(), pose_verdict=verdict, pose_age=LIMITS.pose_age_bridged)
        assert broken(rules, short) is None
        long = replace(short, pose_age=nextafter(LIMITS.pose_age_bridged, inf))
        assert broken(rules, long) is not None


@pytest.mark.parametrize(
    "bit", [SupervisorBits.LOCKED, SupervisorBits.TUMBLED, SupervisorBits.CRASHED], ids=lambda b: b.name
)
def test_a_drone_that_reports_trouble_neither_arms_nor_flies(bit: SupervisorBits) -> None:
    on_ground = replace(good_on_ground(), drone=SupervisorInfo(SupervisorBits.CAN_ARM | bit))
    in_flight = replace(good_in_flight(), drone=SupervisorInfo(FLYING | bit))
    assert broken(PREFLIGHT_RULES, on_ground) is not None
    assert broken(HOVER_RULES, in_flight) is not None
    assert broken(APPROACH_RULES, in_flight) is not None


UPPER_LIMITS = {
    "link_silence": LIMITS.link_silence,
    "pose_age": LIMITS.pose_age,
    "estimate_age": LIMITS.telemetry_age,
    "drone_age": LIMITS.telemetry_age,
    "battery_age": LIMITS.battery_age,
}


@pytest.mark.parametrize(("name", "limit"), UPPER_LIMITS.items())
def test_ages_hold_up_to_their_limit_and_not_beyond(name: str, limit: float) -> None:
    at_limit = replace(good_on_ground(), **{name: limit})
    assert broken(PREFLIGHT_RULES, at_limit) is None
    for beyond in (nextafter(limit, inf), 1e9, inf, nan):
        violation = broken(PREFLIGHT_RULES, replace(good_on_ground(), **{name: beyond}))
        assert violation is not None, (name, beyond)


def test_the_battery_must_reach_its_limit() -> None:
    limit = LIMITS.battery_at_rest
    assert broken(PREFLIGHT_RULES, replace(good_on_ground(), battery_voltage=limit)) is None
    for below in (nextafter(limit, 0.0), 3.0, 0.0, -inf, nan):
        violation = broken(PREFLIGHT_RULES, replace(good_on_ground(), battery_voltage=below))
        assert violation is not None
        assert violation.rule == "battery_at_rest"


def test_heading_difference_is_taken_around_the_circle() -> None:
    def with_yaw(mocap: float, onboard: float) -> Observation:
        return replace(
            good_on_ground(),
            pose_quaternion=turned(yaw=radians(mocap)),
            estimate_quaternion=turned(yaw=radians(onboard)),
        )

    assert broken(PREFLIGHT_RULES, with_yaw(179.0, -178.0)) is None
    assert broken(PREFLIGHT_RULES, with_yaw(0.0, 5.5)) is not None
    assert broken(PREFLIGHT_RULES, with_yaw(90.0, -90.0)) is not None


@pytest.mark.parametrize(("tilt", "yaw"), [(0.0, 90.0), (180.0, 0.0), (90.0, 0.0), (40.0, -120.0)])
def test_attitude_of_known_quaternions(tilt: float, yaw: float) -> None:
    attitude = Attitude.from_quaternion(turned(tilt=radians(tilt), yaw=radians(yaw)))
    assert attitude is not None
    assert degrees(attitude.tilt) == pytest.approx(tilt, abs=1e-5)
    if tilt < 90.0:
        assert degrees(attitude.yaw) == pytest.approx(yaw)


@pytest.mark.parametrize(
    "quaternion", [(0.0, 0.0, 0.0, 0.0), (nan, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.02), (inf, 0.0, 0.0, 1.0)]
)
def test_what_is_no_rotation_has_no_attitude(quaternion: tuple[float, float, float, float]) -> None:
    assert Attitude.from_quaternion(quaternion) is None


def test_a_pose_outside_the_room_ends_the_flight() -> None:
    for place in ((-9.0, 0.0, 1.0), (0.0, 3.0, 1.0), (0.0, 0.0, 2.5), (0.0, 0.0, -0.5)):
        outside = replace(good_in_flight(), pose_position=place, estimate_position=place)
        violation = broken(HOVER_RULES, outside)
        assert violation is not None
        assert violation.rule == "inside_room"


def test_a_violation_says_what_was_measured_and_demanded() -> None:
    low = replace(good_on_ground(), battery_voltage=3.412)
    assert str(broken(PREFLIGHT_RULES, low)) == "battery_at_rest: 3.41 V, need at least 3.8 V"
