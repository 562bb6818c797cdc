"""Safety rules: default-deny, swept over their boundaries."""

from dataclasses import fields, replace
from math import inf, nan, nextafter, pi, radians

import pytest

from mocap_bridge.health import Verdict
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import Observation, SafetyLimits
from perchhw.supervisor.observation import Attitude
from perchhw.supervisor.rules import (
    APPROACH_RULES,
    HOVER_RULES,
    PREFLIGHT_RULES,
    first_violation,
    on_start_mark,
)

from .simulated_attempt import FLYING, good_on_ground

LIMITS = SafetyLimits(start_mark=(-3.0, 0.0, 0.0))
NOT_GUARDED_ON_GROUND = {
    "pose_problem",
    "landing_state",
    "landing_age",
    "end_reason",
    "active_policy_crc",
    "trigger_count",
}


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
    assert first_violation(PREFLIGHT_RULES, good_on_ground(), LIMITS) is None
    assert first_violation(HOVER_RULES, good_in_flight(), LIMITS) is None
    assert first_violation(APPROACH_RULES, good_in_flight(), LIMITS) is None


@pytest.mark.parametrize("name", [f.name for f in fields(Observation) if f.name not in NOT_GUARDED_ON_GROUND])
def test_an_unknown_value_never_arms(name: str) -> None:
    assert first_violation(PREFLIGHT_RULES, replace(good_on_ground(), **{name: None}), LIMITS) is not None


def test_knowing_nothing_never_flies() -> None:
    for rules in (PREFLIGHT_RULES, HOVER_RULES, APPROACH_RULES):
        for rule in rules:
            assert rule(Observation(), LIMITS) is not None, rule.__name__


def test_the_drone_stands_on_its_mark_and_faces_as_it_does() -> None:
    far, turned = LIMITS.start_mark_distance, LIMITS.start_mark_heading
    for place, yaw, fine in (
        ((-3.0 + far, 0.0, 0.07), 0.0, True),
        ((-3.0, -nextafter(far, inf), 0.07), 0.0, False),
        ((-3.0 - 0.8 * far, 0.8 * far, 0.07), 0.0, False),
        ((-3.0, 0.0, 0.07), turned - 1e-9, True),
        ((-3.0, 0.0, 0.07), -turned - 1e-9, False),
        ((-3.0, 0.0, 0.07), pi, False),
    ):
        seen = replace(good_on_ground(), pose_position=place, pose_attitude=Attitude(tilt=0.0, yaw=yaw))
        assert (on_start_mark(seen, LIMITS) is None) == fine, (place, yaw)
    backwards = replace(LIMITS, start_mark=(-3.0, 0.0, pi))
    facing = replace(good_on_ground(), pose_attitude=Attitude(tilt=0.0, yaw=-pi + 0.01))
    assert on_start_mark(facing, backwards) is None
    assert on_start_mark(seen, SafetyLimits()) is None


@pytest.mark.parametrize("verdict", [v for v in Verdict if v is not Verdict.OK])
def test_only_a_good_pose_arms(verdict: Verdict) -> None:
    assert (
        first_violation(PREFLIGHT_RULES, replace(good_on_ground(), pose_verdict=verdict), LIMITS) is not None
    )


@pytest.mark.parametrize("verdict", [None, Verdict.UNKNOWN, Verdict.LOST])
def test_lost_poses_end_a_flight(verdict: Verdict | None) -> None:
    for rules in (HOVER_RULES, APPROACH_RULES):
        assert first_violation(rules, replace(good_in_flight(), pose_verdict=verdict), LIMITS) is not None


@pytest.mark.parametrize("verdict", [Verdict.FROZEN, Verdict.FLIPPED, Verdict.STALE, Verdict.OCCLUDED])
def test_rejected_poses_are_bridged_for_a_moment_and_no_longer(verdict: Verdict) -> None:
    for rules in (HOVER_RULES, APPROACH_RULES):
        short = replace(good_in_flight(), pose_verdict=verdict, pose_age=LIMITS.pose_age_bridged)
        assert first_violation(rules, short, LIMITS) is None
        long = replace(short, pose_age=nextafter(LIMITS.pose_age_bridged, inf))
        assert first_violation(rules, long, LIMITS) is not None


@pytest.mark.parametrize(
    "bit", [SupervisorBits.LOCKED, SupervisorBits.TUMBLED, SupervisorBits.CRASHED], ids=lambda b: b.name
)
def test_a_drone_that_reports_trouble_neither_arms_nor_flies(bit: SupervisorBits) -> None:
    on_ground = replace(good_on_ground(), drone=SupervisorInfo(SupervisorBits.CAN_ARM | bit))
    in_flight = replace(good_in_flight(), drone=SupervisorInfo(FLYING | bit))
    assert first_violation(PREFLIGHT_RULES, on_ground, LIMITS) is not None
    assert first_violation(HOVER_RULES, in_flight, LIMITS) is not None
    assert first_violation(APPROACH_RULES, in_flight, LIMITS) is not None


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
    assert first_violation(PREFLIGHT_RULES, at_limit, LIMITS) is None
    for beyond in (nextafter(limit, inf), 1e9, inf, nan):
        violation = first_violation(PREFLIGHT_RULES, replace(good_on_ground(), **{name: beyond}), LIMITS)
        assert violation is not None, (name, beyond)


def test_the_battery_must_reach_its_limit() -> None:
    limit = LIMITS.battery_at_rest
    assert first_violation(PREFLIGHT_RULES, replace(good_on_ground(), battery_voltage=limit), LIMITS) is None
    for below in (nextafter(limit, 0.0), 3.0, 0.0, -inf, nan):
        violation = first_violation(PREFLIGHT_RULES, replace(good_on_ground(), battery_voltage=below), LIMITS)
        assert violation is not None
        assert violation.rule == "battery_at_rest"


def test_heading_difference_is_taken_around_the_circle() -> None:
    def with_yaw(mocap: float, onboard: float) -> Observation:
        return replace(
            good_on_ground(),
            pose_attitude=Attitude(tilt=0.0, yaw=radians(mocap)),
            estimate_attitude=Attitude(tilt=0.0, yaw=radians(onboard)),
        )

    anywhere = SafetyLimits()
    assert first_violation(PREFLIGHT_RULES, with_yaw(179.0, -178.0), anywhere) is None
    assert first_violation(PREFLIGHT_RULES, with_yaw(0.0, 5.5), anywhere) is not None
    assert first_violation(PREFLIGHT_RULES, with_yaw(90.0, -90.0), anywhere) is not None


def test_attitude_of_known_quaternions() -> None:
    half = 0.5**0.5
    assert Attitude.from_quaternion((0.0, 0.0, half, half)).yaw == pytest.approx(radians(90.0))
    assert Attitude.from_quaternion((0.0, 1.0, 0.0, 0.0)).tilt == pytest.approx(radians(180.0))
    assert Attitude.from_quaternion((0.0, half, 0.0, half)).tilt == pytest.approx(radians(90.0))


def test_a_pose_outside_the_room_ends_the_flight() -> None:
    for place in ((-9.0, 0.0, 1.0), (0.0, 3.0, 1.0), (0.0, 0.0, 2.5), (0.0, 0.0, -0.5)):
        outside = replace(good_in_flight(), pose_position=place, estimate_position=place)
        violation = first_violation(HOVER_RULES, outside, LIMITS)
        assert violation is not None
        assert violation.rule == "inside_room"


def test_a_violation_says_what_was_measured_and_demanded() -> None:
    low = replace(good_on_ground(), battery_voltage=3.412)
    assert (
        str(first_violation(PREFLIGHT_RULES, low, LIMITS)) == "battery_at_rest: 3.41 V, need at least 3.8 V"
    )
