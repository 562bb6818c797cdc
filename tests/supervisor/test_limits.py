"""Every limit of the rules from both sides, as numbers: a limit that moves is seen here."""

from dataclasses import fields, replace
from math import inf, nextafter, radians
from typing import Any

import pytest

from mocap_bridge.health import PoseVerdict
from onboard.room import RoomGeometry
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import Observation, Phase, SafetyLimits, Timing, Violation
from perchhw.supervisor.gate import GateMemory, admit
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.rules import (
    APPROACH_RULES,
    GROUND_RULES,
    HOVER_RULES,
    PREFLIGHT_RULES,
    TAKE_OFF_RULES,
    TEST_FLIGHT_RULES,
    calm_on_ground,
    drone_can_arm,
    drone_can_fly,
    drone_known,
    estimate_agrees_in_flight,
    estimate_agrees_on_ground,
    on_start_mark,
    parameters_as_needed,
    pose_good,
    pose_usable,
    upright_on_ground,
)
from perchhw.supervisor.space import (
    slow_in_hover,
    slow_in_test_flight,
    steady_in_hover,
    steady_in_test_flight,
    upright_in_hover,
    upright_in_test_flight,
)
from perchhw.supervisor.violation import Rule, at_least, at_most, first_violation

from .simulated_attempt import FLYING, READY, good_on_ground, turned
from .states import good_in

LIMITS = SafetyLimits()
GROUND, AIR = good_on_ground(), good_in(Phase.TAKING_OFF)


def judged(rule: Rule, base: Observation, limits: SafetyLimits = LIMITS, **changes: Any) -> Violation | None:
    """What a rule says of `base` with some changes."""
    return rule(admit(replace(base, **changes), GateMemory(), limits, 0.0)[0], limits)


def broken(rules: tuple[Rule, ...], base: Observation, changes: dict[str, Any]) -> str | None:
    """The first rule that does not hold."""
    o, _ = admit(replace(base, **changes), GateMemory(), LIMITS, 0.0)
    violation = first_violation(rules, o, LIMITS)
    return None if violation is None else violation.rule


def at(x: float, y: float, z: float, *velocity: float) -> dict[str, Any]:
    """Seen and estimated at a place, moving."""
    here = {"pose_position": (x, y, z), "estimate_position": (x, y, z)}
    return {**here, "estimate_velocity": velocity} if velocity else here


Edge = tuple[str, dict[str, Any], dict[str, Any]]
EVERYWHERE: list[Edge] = [
    ("link_silence", {"link_silence": 0.5}, {"link_silence": 0.501}),
    ("drone_state_age", {"drone_age": 0.25}, {"drone_age": 0.251}),
    ("pose_age", {"pose_age": 0.3}, {"pose_age": 0.301}),
    ("estimate_age", {"estimate_age": 0.25}, {"estimate_age": 0.251}),
    ("battery_age", {"battery_age": 1.0}, {"battery_age": 1.001}),
]
ON_GROUND: list[Edge] = [
    *EVERYWHERE,
    (
        "tilt_on_ground",
        {"pose_quaternion": turned(tilt=radians(9.99))},
        {"pose_quaternion": turned(tilt=radians(10.01))},
    ),
    ("height_on_ground", at(-3.0, 0.0, 0.25), at(-3.0, 0.0, 0.251)),
    (
        "estimate_to_mocap",
        {"estimate_position": (-3.0, 0.0499, 0.07)},
        {"estimate_position": (-3.0, 0.0501, 0.07)},
    ),
    (
        "heading_to_mocap",
        {"estimate_quaternion": turned(yaw=radians(-4.99))},
        {"estimate_quaternion": turned(yaw=radians(-5.01))},
    ),
    (
        "heading_to_mocap",
        {"pose_quaternion": turned(yaw=radians(-4.99))},
        {"pose_quaternion": turned(yaw=radians(-5.01))},
    ),
    (
        "speed_on_ground",
        {"estimate_velocity": (0.09, 0.0, -0.119)},
        {"estimate_velocity": (0.09, 0.0, -0.121)},
    ),
    ("battery_at_rest", {"battery_voltage": 3.8}, {"battery_voltage": 3.799}),
    ("battery_full", {"battery_voltage": 4.4}, {"battery_voltage": 4.401}),
]
IN_THE_AIR: list[Edge] = [
    *EVERYWHERE,
    (
        "estimate_to_mocap",
        {"pose_position": (-2.0, 0.249, 1.0), **{"estimate_position": (-2.0, 0.0, 1.0)}},
        {"pose_position": (-2.0, 0.251, 1.0), "estimate_position": (-2.0, 0.0, 1.0)},
    ),
    ("battery_in_flight", {"battery_voltage": 2.72}, {"battery_voltage": 2.719}),
    ("battery_full", {"battery_voltage": 4.4}, {"battery_voltage": 4.401}),
    ("fence_x_min", at(-6.0, 0.0, 1.0, -2.08, 0.0, 0.0), at(-6.0, 0.0, 1.0, -2.09, 0.0, 0.0)),
    ("fence_x_max", at(1.5, 0.0, 1.0, 2.08, 0.0, 0.0), at(1.5, 0.0, 1.0, 2.09, 0.0, 0.0)),
    ("fence_y_min", at(-2.0, -0.5, 1.0, 0.0, -2.08, 0.0), at(-2.0, -0.5, 1.0, 0.0, -2.09, 0.0)),
    ("fence_y_max", at(-2.0, 0.5, 1.0, 0.0, 2.08, 0.0), at(-2.0, 0.5, 1.0, 0.0, 2.09, 0.0)),
]
CEILING: Edge = ("fence_ceiling", at(-2.0, 0.0, 1.6, 0.0, 0.0, 2.08), at(-2.0, 0.0, 1.6, 0.0, 0.0, 2.09))
FLOOR: Edge = ("fence_floor", at(-2.0, 0.0, 0.5, 0.0, 0.0, -2.08), at(-2.0, 0.0, 0.5, 0.0, 0.0, -2.09))
HOVER_ROTATION: Edge = (
    "rotation_in_hover",
    {"body_rates": (5.99, -8.0, 0.0)},
    {"body_rates": (6.01, -8.0, 0.0)},
)
RATES: Edge = ("rates_age", {"rates_age": 0.25}, {"rates_age": 0.251})
HOVER: list[Edge] = [
    CEILING,
    (
        "tilt_in_hover",
        {"estimate_quaternion": turned(tilt=radians(34.99))},
        {"estimate_quaternion": turned(tilt=radians(35.01))},
    ),
    ("speed_in_hover", at(-2.0, 0.0, 1.0, 1.5, 0.0, 1.99), at(-2.0, 0.0, 1.0, 1.5, 0.0, 2.01)),
    HOVER_ROTATION,
    RATES,
]
IN_TEST_FLIGHT: list[Edge] = [
    CEILING,
    FLOOR,
    (
        "tilt_in_test_flight",
        {"estimate_quaternion": turned(tilt=radians(64.99))},
        {"estimate_quaternion": turned(tilt=radians(65.01))},
    ),
    ("speed_in_test_flight", at(-6.0, 0.0, 1.0, 6.99, 0.0, 0.0), at(-6.0, 0.0, 1.0, 7.01, 0.0, 0.0)),
    ("rotation_in_test_flight", {"body_rates": (0.0, 12.0, 15.99)}, {"body_rates": (0.0, 12.0, 16.01)}),
    RATES,
]
PREFLIGHT: list[Edge] = [
    ("pose_age", {"pose_age": 0.1}, {"pose_age": 0.101}),
    ("pose", {"pose_verdict": PoseVerdict.OK}, {"pose_verdict": PoseVerdict.STALE}),
    ("drone_can_arm", {"drone": SupervisorInfo(READY)}, {"drone": SupervisorInfo(0)}),
]
SETS: list[tuple[str, tuple[Rule, ...], Observation, list[Edge]]] = [
    ("ground", GROUND_RULES, GROUND, ON_GROUND),
    ("preflight", PREFLIGHT_RULES, GROUND, [*(e for e in ON_GROUND if e[0] != "pose_age"), *PREFLIGHT]),
    ("take-off", TAKE_OFF_RULES, AIR, [*IN_THE_AIR, *HOVER]),
    ("hover", HOVER_RULES, AIR, [*IN_THE_AIR, *HOVER, FLOOR]),
    ("test flight", TEST_FLIGHT_RULES, AIR, [*IN_THE_AIR, *IN_TEST_FLIGHT]),
    ("approach", APPROACH_RULES, AIR, [*IN_THE_AIR, FLOOR, HOVER_ROTATION, RATES]),
]
CASES = [(name, rules, base, edge) for name, rules, base, edges in SETS for edge in edges]


@pytest.mark.parametrize(
    ("rules", "base", "edge"),
    [case[1:] for case in CASES],
    ids=[f"{case[0]}: {case[3][0]}" for case in CASES],
)
def test_a_rule_holds_up_to_its_limit_and_not_beyond(
    rules: tuple[Rule, ...], base: Observation, edge: Edge
) -> None:
    rule, inside, outside = edge
    assert broken(rules, base, inside) is None
    assert broken(rules, base, outside) == rule


# --- the drone, the pose, the mark ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rule", "bits", "said"),
    [
        (drone_known, READY, None),
        (drone_known, READY | SupervisorBits.LOCKED, "locked"),
        (drone_known, READY | SupervisorBits.TUMBLED, "tumbled"),
        (drone_known, READY | SupervisorBits.CRASHED, "crashed"),
        (drone_known, None, "unknown"),
        (drone_can_arm, READY, None),
        (drone_can_arm, FLYING, "no"),
        (drone_can_arm, None, "unknown"),
        (drone_can_fly, FLYING, None),
        (drone_can_fly, READY, "no"),
        (drone_can_fly, None, "unknown"),
    ],
)
def test_the_drone_must_say_that_it_is_able(
    rule: Rule, bits: SupervisorBits | None, said: str | None
) -> None:
    violation = judged(rule, GROUND, drone=None if bits is None else SupervisorInfo(bits))
    assert (None if violation is None else violation.measured) == said


@pytest.mark.parametrize("verdict", [*PoseVerdict, None])
def test_what_is_said_of_the_pose_decides(verdict: PoseVerdict | None) -> None:
    good = judged(pose_good, GROUND, pose_verdict=verdict)
    usable = judged(pose_usable, GROUND, pose_verdict=verdict)
    name = "unknown" if verdict is None else verdict.name
    assert str(good) == ("None" if verdict is PoseVerdict.OK else f"pose: {name}, need OK")
    hopeless = verdict in (None, PoseVerdict.UNKNOWN, PoseVerdict.LOST)
    assert str(usable) == (f"pose: {name}, need OK" if hopeless else "None")
    told = judged(pose_good, GROUND, pose_verdict=PoseVerdict.LOST, pose_problem="no frames")
    assert str(told) == "pose: LOST (no frames), need OK"


MARKED = replace(LIMITS, start_mark=(-3.0, 0.5, radians(179.0)))


@pytest.mark.parametrize(
    ("x", "y", "heading", "rule"),
    [
        (-3.0, 0.5, 179.0, None),
        (-3.0, 0.749, -175.0, None),
        (-3.0, 0.751, 179.0, "start_mark_distance"),
        (-2.751, 0.5, 179.0, None),
        (-2.749, 0.5, 179.0, "start_mark_distance"),
        (-2.8, 0.7, 179.0, "start_mark_distance"),
        (-3.0, 0.5, -166.1, None),
        (-3.0, 0.5, -165.9, "start_mark_heading"),
        (-3.0, 0.5, 164.1, None),
        (-3.0, 0.5, 163.9, "start_mark_heading"),
        (-3.0, 0.5, 0.0, "start_mark_heading"),
    ],
)
def test_a_drone_stands_on_its_mark_and_looks_ahead(
    x: float, y: float, heading: float, rule: str | None
) -> None:
    violation = judged(
        on_start_mark,
        GROUND,
        MARKED,
        pose_position=(x, y, 0.07),
        pose_quaternion=turned(yaw=radians(heading)),
    )
    assert (None if violation is None else violation.rule) == rule


def test_a_height_is_measured_from_the_floor_of_the_room() -> None:
    lowered = replace(LIMITS, room=RoomGeometry(floor_z=-2.0))
    assert judged(upright_on_ground, GROUND, lowered, pose_position=(-3.0, 0.0, -1.751)) is None
    assert judged(upright_on_ground, GROUND, lowered, pose_position=(-3.0, 0.0, -1.749)) is not None


@pytest.mark.parametrize(
    ("ok", "problem", "said"),
    [
        (True, None, None),
        (True, "old news", None),
        (False, "powerDist.idleThrust is 7000", "wrong (powerDist.idleThrust is 7000)"),
        (False, None, "wrong"),
        (None, None, "unknown"),
        (None, "not read back", "unknown (not read back)"),
    ],
)
def test_the_parameters_must_be_read_back_as_needed(
    ok: bool | None, problem: str | None, said: str | None
) -> None:
    violation = judged(parameters_as_needed, GROUND, parameters_ok=ok, parameters_problem=problem)
    assert (None if violation is None else violation.measured) == said


@pytest.mark.parametrize(
    ("rule", "name", "said"),
    [
        (estimate_agrees_in_flight, "pose_position", "estimate_to_mocap: unknown, need at most 0.25 m"),
        (estimate_agrees_in_flight, "estimate_position", "estimate_to_mocap: unknown, need at most 0.25 m"),
        (estimate_agrees_on_ground, "pose_position", "estimate_to_mocap: unknown, need at most 0.05 m"),
        (estimate_agrees_on_ground, "estimate_position", "estimate_to_mocap: unknown, need at most 0.05 m"),
        (estimate_agrees_on_ground, "pose_quaternion", "heading_to_mocap: unknown, need known"),
        (estimate_agrees_on_ground, "estimate_quaternion", "heading_to_mocap: unknown, need known"),
        (upright_on_ground, "pose_position", "height_on_ground: unknown, need at most 0.25 m"),
        (upright_on_ground, "pose_quaternion", "tilt_on_ground: unknown, need at most 10 deg"),
        (calm_on_ground, "estimate_velocity", "speed_on_ground: unknown, need at most 0.15 m/s"),
        (upright_in_hover, "estimate_quaternion", "tilt_in_hover: unknown, need at most 35 deg"),
        (slow_in_hover, "estimate_velocity", "speed_in_hover: unknown, need at most 2.5 m/s"),
        (steady_in_hover, "body_rates", "rotation_in_hover: unknown, need at most 10 rad/s"),
        (upright_in_test_flight, "estimate_quaternion", "tilt_in_test_flight: unknown, need at most 65 deg"),
        (slow_in_test_flight, "estimate_velocity", "speed_in_test_flight: unknown, need at most 7 m/s"),
        (steady_in_test_flight, "body_rates", "rotation_in_test_flight: unknown, need at most 20 rad/s"),
    ],
)
def test_a_rule_denies_what_it_does_not_know(rule: Rule, name: str, said: str) -> None:
    unknown: dict[str, Any] = {name: None}
    assert str(judged(rule, GROUND, **unknown)) == said
    assert judged(rule, GROUND) is None


@pytest.mark.parametrize("name", ["pose_position", "pose_quaternion"])
def test_a_mark_is_not_stood_on_unseen(name: str) -> None:
    unknown: dict[str, Any] = {name: None}
    here = {"pose_position": (-3.0, 0.5, 0.07), "pose_quaternion": turned(yaw=radians(179.0))}
    violation = judged(on_start_mark, GROUND, MARKED, **{**here, **unknown})
    assert violation is not None
    assert violation.measured == "unknown"


# --- comparisons, and what no look shows ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "most", "least"),
    [
        (2.0, None, None),
        (nextafter(2.0, 0.0), None, "r: 2 m, need at least 2 m"),
        (nextafter(2.0, 9.0), "r: 2 m, need at most 2 m", None),
        (inf, "r: inf m, need at most 2 m", "r: inf m, need at least 2 m"),
        (-inf, "r: -inf m, need at most 2 m", "r: -inf m, need at least 2 m"),
        (float("nan"), "r: nan m, need at most 2 m", "r: nan m, need at least 2 m"),
        (None, "r: unknown, need at most 2 m", "r: unknown, need at least 2 m"),
    ],
)
def test_a_comparison_denies_what_it_does_not_know(
    value: float | None, most: str | None, least: str | None
) -> None:
    assert str(at_most("r", value, 2.0, "m")) == str(most)
    assert str(at_least("r", value, 2.0, "m")) == str(least)


def test_the_first_rule_that_is_broken_is_named() -> None:
    def breaks(name: str) -> Rule:
        return lambda o, limits: Violation(name, "a", "b")

    holds: Rule = lambda o, limits: None  # noqa: E731
    nothing = Admitted(Observation())
    assert first_violation((holds, breaks("x"), breaks("y")), nothing, LIMITS) == Violation("x", "a", "b")
    assert first_violation((holds, holds), nothing, LIMITS) is None


TIMES = {
    "checks_hold": 0.5, "checks_deadline": 8.0, "upload_deadline": 20.0, "ready_deadline": 10.0,
    "arm_deadline": 3.0, "arm_hold": 0.1, "take_off": 2.0, "move_margin": 4.0, "hover_hold": 0.6,
    "approach_arm_deadline": 2.0, "approach_margin": 1.0, "course_margin": 2.0, "flip_deadline": 1.0,
    "settle": 2.5, "brake_deadline": 3.0, "land": 3.5, "land_margin": 3.0, "stop_hold": 0.3, "hang_hold": 0.3,
    "switches_deadline": 1.0, "bits_delay": 0.05, "watchdog_margin": 0.5, "disarm_hold": 0.2,
    "disarm_deadline": 2.0, "stop_deadline": 8.0,
}  # fmt: skip
OTHER_LIMITS = {"corridor_time": 0.2, "flight_time": 60.0, "battery_filter": 0.2, "wall_margin": 0.0}
"""Those that no single look shows; the others stand as numbers in the tables of the tests."""


def test_the_times_of_the_phases_are_these() -> None:
    assert {field.name: getattr(Timing(), field.name) for field in fields(Timing)} == TIMES
    assert {name: getattr(LIMITS, name) for name in OTHER_LIMITS} == OTHER_LIMITS
    assert LIMITS.start_mark is None
