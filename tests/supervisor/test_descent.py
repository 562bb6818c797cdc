"""Braking, landing and disarming at their limits: just inside and outside, just before and after."""

from dataclasses import replace
from math import nextafter, radians
from typing import Any

import pytest

from onboard.app_interface import LandingState
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import FlightState, Observation, Phase, SafetyLimits, Tick, Timing, step
from perchhw.supervisor.descent import DESCENT_RULES
from perchhw.supervisor.events import Disarm, EmergencyStop, Land
from perchhw.supervisor.gate import GateMemory, admit
from perchhw.supervisor.violation import first_violation

from .simulated_attempt import FLYING, MISSION, PERIOD, READY, TEST_FLIGHT, turned
from .states import DESCENDING, good_in, state_in

LIMITS, TIMING = SafetyLimits(), Timing()
LATE = {"estimate_age": 0.5}
"""The estimate is late: nothing of it is admitted, and the drone has it still."""


def broken(**changes: Any) -> str | None:
    """Which rule of the descent does not hold when all is well but for `changes`."""
    o, _ = admit(replace(good_in(Phase.LANDING), **changes), GateMemory(), LIMITS, 0.0)
    violation = first_violation(DESCENT_RULES, o, LIMITS)
    return None if violation is None else violation.rule


def seen_at(x: float, y: float) -> dict[str, Any]:
    return {"pose_position": (x, y, 1.0), "estimate_position": (x, y, 1.0)}


def blind_at(x: float, y: float) -> dict[str, Any]:
    return {"pose_position": None, "estimate_position": (x, y, 1.0)}


EDGES: list[tuple[str, dict[str, Any], dict[str, Any]]] = [
    ("link_silence", {"link_silence": 1.0}, {"link_silence": nextafter(1.0, 2.0)}),
    ("drone_state_age", {"drone_age": 1.0}, {"drone_age": nextafter(1.0, 2.0)}),
    ("descent_estimate", {"estimate_age": 1.0}, {"estimate_age": nextafter(1.0, 2.0)}),
    ("descent_estimate", LATE, {"estimate_age": None}),
    ("descent_estimate", {}, {"estimate_position": None}),
    ("descent_estimate", {"estimate_age": 0.26}, {"estimate_age": 0.25, "estimate_velocity": None}),
    (
        "descent_disagreement",
        {"estimate_position": (-3.0, 0.5, 1.0), "pose_position": (-3.0, -0.499, 1.0)},
        {"estimate_position": (-3.0, 0.5, 1.0), "pose_position": (-3.0, -0.501, 1.0)},
    ),
    (
        "descent_speed_blind",
        {"pose_position": None, "estimate_velocity": (0.0, 2.4, -3.2)},
        {"pose_position": None, "estimate_velocity": (0.0, 2.41, -3.2)},
    ),
    (
        "descent_speed",
        {"estimate_velocity": (0.0, 2.4, -3.2)},
        {"estimate_velocity": (0.0, 2.41, -3.2)},
    ),
    ("descent_speed", {}, {"estimate_velocity": (4.01, 0.0, 0.0)}),
    (
        "descent_rotation",
        {"body_rates": (12.0, -12.0, 10.5)},
        {"body_rates": (12.0, -12.0, 10.6)},
    ),
    ("descent_rotation", {"rates_age": None, "body_rates": None}, {"body_rates": None}),
    ("descent_rotation", {"rates_age": nextafter(0.25, 1.0)}, {"rates_age": 0.25, "body_rates": None}),
    (
        "descent_tilt",
        {"estimate_quaternion": turned(tilt=radians(74.9))},
        {"estimate_quaternion": turned(tilt=radians(75.1))},
    ),
    ("descent_tilt", LATE, {"estimate_quaternion": None}),
    *(
        ("descent_beyond_walls", place(*inside), place(*outside))
        for place in (seen_at, blind_at)
        for inside, outside in (
            ((-6.74, 0.0), (-6.76, 0.0)),
            ((2.24, 0.0), (2.26, 0.0)),
            ((-3.0, -1.24), (-3.0, -1.26)),
            ((-3.0, 1.24), (-3.0, 1.26)),
        )
    ),
    (
        "descent_beyond_walls",
        {"pose_position": (-3.0, 1.24, 1.0), **LATE},
        {"pose_position": (-3.0, 1.26, 1.0), **LATE},
    ),
    (
        "descent_beyond_walls",
        {"pose_position": (-3.0, 1.24, 1.0), "estimate_position": (-3.0, 1.3, 1.0)},
        {"pose_position": (-3.0, 1.26, 1.0), "estimate_position": (-3.0, 1.2, 1.0)},
    ),
]


@pytest.mark.parametrize(("rule", "inside", "outside"), EDGES, ids=[edge[0] for edge in EDGES])
def test_a_rule_of_the_descent_holds_up_to_its_limit(
    rule: str, inside: dict[str, Any], outside: dict[str, Any]
) -> None:
    assert broken(**inside) is None
    assert broken(**outside) == rule


def test_who_sees_nothing_and_is_only_late_is_left_alone() -> None:
    assert broken(**LATE, pose_position=None) is None


def test_a_place_that_nobody_knows_is_outside() -> None:
    o = admit(Observation(), GateMemory(), LIMITS, 0.0)[0]
    assert [str(rule(o, LIMITS)) for rule in DESCENT_RULES] == [
        "link_silence: unknown, need at most 1 s",
        "descent_estimate: unknown, need known",
        "descent_tilt: unknown, need at most 75 deg",
        "None",
        "descent_place: unknown, need known",
        "descent_speed_blind: unknown, need at most 4 m/s",
    ]


def test_an_estimate_counts_as_late_from_where_it_is_not_admitted_any_more() -> None:
    edge = {"estimate_age": LIMITS.telemetry_age, "estimate_quaternion": None}
    assert broken(**edge) == "descent_tilt"
    assert broken(**{**edge, "estimate_age": nextafter(LIMITS.telemetry_age, 1.0)}) is None


@pytest.mark.parametrize("seen", [True, False])
def test_a_landing_from_a_course_has_the_speed_of_a_course(seen: bool) -> None:
    """From 6 m/s a drone that brakes with 8 m/s2 is above 4 m/s for longer than a rule may be broken."""
    place: dict[str, Any] = {} if seen else {"pose_position": None}
    for mission, limit in ((MISSION, 4.0), (TEST_FLIGHT, 7.0)):
        for speed, orders in ((limit, []), (nextafter(limit, 9.0), [EmergencyStop])):
            o = replace(good_in(Phase.LANDING), estimate_velocity=(-speed, 0.0, 0.0), **place)
            state, _ = step(state_in(Phase.LANDING), Tick(o), 0.1, mission)
            _, given = step(state, Tick(o), 0.1 + TIMING.stop_hold, mission)
            assert [type(order.command) for order in given] == orders


# --- braking and landing ----------------------------------------------------------------------------------


def look(state: FlightState, now: float = PERIOD, **changes: Any) -> tuple[FlightState, list[type]]:
    """The state after one look, well but for `changes`, and what was ordered."""
    o = replace(good_in(state.phase), **changes)
    after, orders = step(state, Tick(o), now, MISSION)
    return after, [type(order.command) for order in orders]


@pytest.mark.parametrize("phase", DESCENDING)
@pytest.mark.parametrize("first", [None, "operator"])
def test_a_descent_that_is_stopped_keeps_its_first_reason(phase: Phase, first: str | None) -> None:
    state = replace(state_in(phase), aborted_by=first, bad_since=0.0)
    after, ordered = look(state, 0.4, link_silence=1.5)
    assert ordered == [EmergencyStop]
    assert after.aborted_by == (first or "link_silence: 1.5 s, need at most 1 s")


BRAKED: list[tuple[LandingState | None, Phase, list[type]]] = [
    (LandingState.IDLE, Phase.LANDING, [Land]),
    (LandingState.TRAJECTORY_ARMED, Phase.BRAKING, []),
    (LandingState.APPROACH, Phase.BRAKING, []),
    (LandingState.FLIP, Phase.BRAKING, []),
    (LandingState.CUT, Phase.SETTLING, []),
    (LandingState.BRAKE, Phase.BRAKING, []),
    (LandingState.HOLD, Phase.LANDING, [Land]),
    (LandingState.FAULT, Phase.SETTLING, []),
    (None, Phase.BRAKING, []),
]


@pytest.mark.parametrize(("reported", "then", "orders"), BRAKED)
def test_a_brake_ends_when_the_drone_holds_or_has_cut_its_motors(
    reported: LandingState | None, then: Phase, orders: list[type]
) -> None:
    after, ordered = look(state_in(Phase.BRAKING), landing_state=reported)
    assert (after.phase, ordered) == (then, orders)
    if then is Phase.SETTLING:
        assert after.waiting_for == "the body to rest"


@pytest.mark.parametrize("unknown", [{"landing_state": 99}, {"landing_age": 0.26}, {"landing_age": None}])
def test_a_brake_whose_state_is_not_known_for_long_is_landed(unknown: dict[str, Any]) -> None:
    """The hand-over asks the drone itself, and waits until it has let go."""
    state, ordered = look(state_in(Phase.BRAKING), 0.5, **unknown)
    assert (state.phase, ordered) == (Phase.BRAKING, [])
    before, ordered = look(state, nextafter(0.5 + TIMING.stop_hold, 0.0), **unknown)
    assert (before.phase, ordered) == (Phase.BRAKING, [])
    after, ordered = look(before, 0.5 + TIMING.stop_hold, **unknown)
    assert (after.phase, ordered) == (Phase.LANDING, [Land])
    known, _ = look(before, 0.5 + TIMING.stop_hold)
    assert (known.phase, known.good_since) == (Phase.BRAKING, None)


def test_a_drone_that_may_not_fly_any_more_rests_after_its_brake() -> None:
    after, ordered = look(state_in(Phase.BRAKING), drone=SupervisorInfo(READY))
    assert (after.phase, ordered) == (Phase.SETTLING, [])
    assert look(state_in(Phase.BRAKING), drone=None)[0].phase is Phase.BRAKING


@pytest.mark.parametrize(
    ("phase", "deadline", "order"),
    [
        (Phase.BRAKING, TIMING.brake_deadline, Land),
        (Phase.LANDING, TIMING.land + TIMING.land_margin, EmergencyStop),
    ],
)
def test_a_descent_has_its_time_to_the_end_and_no_more(phase: Phase, deadline: float, order: type) -> None:
    state, ordered = look(state_in(phase), deadline)
    assert (state.phase, ordered) == (phase, [])
    assert look(state_in(phase), nextafter(deadline, 99.0))[1] == [order]


FLOOR = {"pose_position": (-3.0, 0.0, 0.249), "estimate_position": (-3.0, 0.0, 0.249)}
AIR = {"pose_position": (-3.0, 0.0, 0.25), "estimate_position": (-3.0, 0.0, 0.25)}


@pytest.mark.parametrize(
    ("seconds", "place", "orders"),
    [
        (TIMING.land, FLOOR, [Disarm]),
        (nextafter(TIMING.land, 0.0), FLOOR, []),
        (TIMING.land + 1.0, FLOOR, [Disarm]),
        (TIMING.land, AIR, []),
        (TIMING.land + 1.0, AIR, []),
        (TIMING.land, {**FLOOR, "estimate_age": 0.5}, []),
    ],
)
def test_a_landing_disarms_on_the_floor_once_the_descent_is_over(
    seconds: float, place: dict[str, Any], orders: list[type]
) -> None:
    ordered_at_once = replace(state_in(Phase.LANDING), answered_at=0.0)
    assert look(ordered_at_once, seconds, **place)[1] == orders


def test_a_landing_that_begins_late_is_left_its_time() -> None:
    """The drone braked for another 1.5 s before it took the order: low by now, and on its way down."""
    late = replace(state_in(Phase.LANDING), answered_at=1.5)
    assert look(late, TIMING.land, **FLOOR)[1] == []
    assert look(late, TIMING.land + 1.49, **FLOOR)[1] == []
    assert look(late, TIMING.land + 1.5, **FLOOR)[1] == [Disarm]
    assert look(state_in(Phase.LANDING), TIMING.land + TIMING.land_margin, **FLOOR)[1] == []


# --- disarming --------------------------------------------------------------------------------------------

OFF = SupervisorInfo(READY)
ANSWERED = replace(state_in(Phase.DISARMING), answered_at=1.0)


@pytest.mark.parametrize(
    ("bits", "off"),
    [
        (FLYING, False),
        (SupervisorBits.ARMED | SupervisorBits.CAN_FLY, False),
        (SupervisorBits.ARMED, False),
        (SupervisorBits.ARMED | SupervisorBits.TUMBLED, False),
        (SupervisorBits.CAN_FLY, True),
        (READY, True),
        (SupervisorBits.LOCKED, True),
        (SupervisorBits(0), True),
    ],
)
def test_only_a_drone_that_is_not_armed_is_off(bits: SupervisorBits, off: bool) -> None:
    """One that is armed and may not fly at this moment (it hangs upside down, or still arms) is not."""
    state, _ = look(ANSWERED, 1.5, drone=SupervisorInfo(bits))
    assert (state.good_since is not None) == off
    state, _ = look(state, 1.5 + TIMING.disarm_hold + 0.01, drone=SupervisorInfo(bits))
    assert state.phase is (Phase.DONE if off else Phase.DISARMING)


@pytest.mark.parametrize(
    ("now", "age", "renewed"),
    [
        (1.0 + TIMING.bits_delay, 0.0, True),
        (nextafter(1.0 + TIMING.bits_delay, 0.0), 0.0, False),
        (1.25, 0.19, True),
        (1.25, 0.21, False),
        (1.0, 0.0, False),
    ],
)
def test_bits_count_when_they_are_newer_than_the_answer(now: float, age: float, renewed: bool) -> None:
    state, _ = look(ANSWERED, now, drone=OFF, drone_age=age)
    assert (state.good_since is not None) == renewed


def test_disarming_has_its_time_to_the_end_and_no_more() -> None:
    state, ordered = look(state_in(Phase.DISARMING), TIMING.disarm_deadline)
    assert (state.phase, ordered) == (Phase.DISARMING, [])
    state, ordered = look(state_in(Phase.DISARMING), nextafter(TIMING.disarm_deadline, 9.0))
    assert ordered == [EmergencyStop]
    assert state.aborted_by == "disarming: the drone did not confirm it"


def test_disarming_ends_as_soon_as_the_bits_have_held() -> None:
    begun = replace(ANSWERED, good_since=0.0, answered_at=-1.0)
    assert look(begun, nextafter(TIMING.disarm_hold, 0.0), drone=OFF)[0].phase is Phase.DISARMING
    assert look(begun, TIMING.disarm_hold, drone=OFF)[0].phase is Phase.DONE
