"""The approach, the flip and the settling at their limits: what the drone reports, just before and after."""

from dataclasses import replace
from math import nextafter, pi, radians
from typing import Any

import pytest

from mocap_bridge.health import PoseVerdict
from onboard.app_interface import EndReason, LandingState
from onboard.room import RoomGeometry
from perchhw.supervisor import FlightState, Observation, Phase, SafetyLimits, Tick, Timing, step
from perchhw.supervisor.events import Brake, Disarm, DisarmPolicy, EmergencyStop
from perchhw.supervisor.gate import GateMemory, admit
from perchhw.supervisor.landed import does_not_hold

from .simulated_attempt import INVERTED, MISSION, PERIOD, PLAN, turned
from .states import good_in, state_in

TIMING = Timing()
LONGEST_APPROACH = MISSION.approach_duration + TIMING.approach_margin


def look(state: FlightState, now: float = PERIOD, **changes: Any) -> tuple[FlightState, list[type]]:
    """The state after one look, well but for `changes`, and what was ordered."""
    o = replace(good_in(state.phase), **changes)
    after, orders = step(state, Tick(o), now, MISSION)
    return after, [type(order.command) for order in orders]


REPORTED: list[tuple[LandingState, Phase, str, list[type]]] = [
    (LandingState.IDLE, Phase.APPROACHING, "", []),
    (LandingState.TRAJECTORY_ARMED, Phase.APPROACHING, "", []),
    (LandingState.APPROACH, Phase.APPROACHING, "", []),
    (LandingState.FLIP, Phase.FLIPPING, "the end of the flip", []),
    (LandingState.CUT, Phase.SETTLING, "the body to rest", []),
    (LandingState.BRAKE, Phase.BRAKING, "the drone to brake", [DisarmPolicy]),
    (LandingState.HOLD, Phase.BRAKING, "the drone to brake", [DisarmPolicy]),
    (LandingState.FAULT, Phase.BRAKING, "the drone to brake", [Brake]),
]


def test_every_landing_state_has_its_answer() -> None:
    assert {reported for reported, *_ in REPORTED} == set(LandingState)


@pytest.mark.parametrize(("reported", "then", "waits", "orders"), REPORTED, ids=str)
def test_what_the_landing_machine_reports_moves_the_approach(
    reported: LandingState, then: Phase, waits: str, orders: list[type]
) -> None:
    after, ordered = look(
        state_in(Phase.APPROACHING), landing_state=reported, end_reason=EndReason.MISSED_TRIGGER
    )
    assert (after.phase, ordered, after.waiting_for) == (then, orders, waits)
    assert after.triggered == (reported is LandingState.FLIP)
    fault = "the drone reports a fault in its landing state machine"
    assert after.aborted_by == (fault if reported is LandingState.FAULT else None)


@pytest.mark.parametrize("reported", [LandingState.BRAKE, LandingState.HOLD])
@pytest.mark.parametrize("reason", [*EndReason, None])
def test_a_brake_is_an_abort_unless_the_trigger_was_missed(
    reported: LandingState, reason: EndReason | None
) -> None:
    def why(**pose: Any) -> str | None:
        return look(state_in(Phase.APPROACHING), landing_state=reported, end_reason=reason, **pose)[
            0
        ].aborted_by

    if reason is EndReason.MISSED_TRIGGER:
        assert why() is None
        return
    name = "unknown" if reason is None else reason.name.lower()
    assert why() == f"drone_broke_off: {name}"
    assert why(pose_verdict=PoseVerdict.LOST) == f"drone_broke_off: {name} (pose: LOST, need OK)"


@pytest.mark.parametrize(("before", "count", "fired"), [(0, 1, True), (3, 3, False), (3, 4, True)])
def test_a_trigger_is_one_more_than_before(before: int, count: int, fired: bool) -> None:
    state = replace(state_in(Phase.APPROACHING), triggers_before=before)
    assert look(state, landing_state=LandingState.CUT, trigger_count=count)[0].triggered is fired


def test_the_approach_has_its_time_to_the_end_and_no_more() -> None:
    waits = {"landing_state": LandingState.TRAJECTORY_ARMED}
    state = state_in(Phase.APPROACHING)
    assert look(state, LONGEST_APPROACH, **waits)[0].phase is Phase.APPROACHING
    after, ordered = look(state, nextafter(LONGEST_APPROACH, 99.0), **waits)
    assert (after.phase, ordered) == (Phase.BRAKING, [Brake])
    assert after.aborted_by == "the approach ended neither in a trigger nor in a brake"


def test_an_approach_without_a_plan_is_broken_off() -> None:
    blind = replace(MISSION, corridor=None)
    after, (order,) = step(state_in(Phase.APPROACHING), Tick(good_in(Phase.APPROACHING)), PERIOD, blind)
    assert isinstance(order.command, Brake)
    assert after.aborted_by == "corridor: the planned approach is unknown, need one"


def test_the_clock_of_the_plan_starts_when_the_drone_is_seen_to_set_out() -> None:
    waits = {"landing_state": LandingState.TRAJECTORY_ARMED}
    state, _ = look(state_in(Phase.APPROACHING), 0.5, **waits)
    assert state.approach_began is None
    state, _ = look(state, 0.6)
    assert state.approach_began == 0.6
    assert look(state, 0.7)[0].approach_began == 0.6


def test_until_it_sets_out_the_drone_belongs_at_the_start() -> None:
    waits = {"landing_state": LandingState.TRAJECTORY_ARMED}
    state = state_in(Phase.APPROACHING)
    for seconds in (-0.61, 0.64):
        place = (PLAN.x0 + seconds, PLAN.y0, PLAN.z0)
        after, _ = look(state, 2.0, **waits, pose_position=place, estimate_position=place)
        assert (after.aborted_by or "").startswith("corridor_distance")
    place = (PLAN.x0, PLAN.y0, PLAN.z0)
    for speed, broken in ((1.39, False), (-1.19, False), (-1.21, True), (1.41, True)):
        changes = {"pose_position": place, "estimate_position": place}
        after, _ = look(state, 2.0, **waits, **changes, estimate_velocity=(speed, 0.0, 0.0))
        assert (after.aborted_by is not None) == broken


# --- the flip ---------------------------------------------------------------------------------------------


def test_a_flip_is_measured_from_where_the_drone_was_seen_last() -> None:
    place = (PLAN.x0, PLAN.y0 + 0.1, PLAN.z0 + 0.2)
    state, _ = look(state_in(Phase.APPROACHING), pose_position=place)
    assert state.flip_height == place[2]
    unseen, _ = look(state, 2 * PERIOD, pose_position=None, pose_verdict=PoseVerdict.OK)
    assert unseen.flip_height == place[2]


CEILING = PLAN.ceiling_z
FLIPS: list[tuple[tuple[float, float, float] | None, float | None, str | None]] = [
    ((0.0, 0.0, CEILING - 0.75), CEILING - 0.25, None),
    ((0.0, 0.0, CEILING - 0.751), CEILING - 0.25, "flip_height"),
    ((-6.5, -1.0, CEILING - 0.1), CEILING - 0.3, None),
    ((2.0, 1.0, CEILING - 0.1), CEILING - 0.3, None),
    ((-6.51, 0.0, CEILING - 0.1), CEILING - 0.3, "flip_in_room"),
    ((2.01, 0.0, CEILING - 0.1), CEILING - 0.3, "flip_in_room"),
    ((0.0, -1.01, CEILING - 0.1), CEILING - 0.3, "flip_in_room"),
    ((0.0, 1.01, CEILING - 0.1), CEILING - 0.3, "flip_in_room"),
    (None, CEILING - 0.3, None),
    ((0.0, 0.0, 0.1), None, None),
]


@pytest.mark.parametrize(("place", "began_at", "rule"), FLIPS, ids=str)
@pytest.mark.parametrize("first", [None, "record_lost: full"])
def test_a_flip_stays_under_the_ceiling_and_in_the_room(
    place: tuple[float, float, float] | None, began_at: float | None, rule: str | None, first: str | None
) -> None:
    state = replace(state_in(Phase.FLIPPING), flip_height=began_at, aborted_by=first)
    after, ordered = look(state, pose_position=place)
    assert (after.phase, ordered) == (
        (Phase.FLIPPING, []) if rule is None else (Phase.STOPPING, [EmergencyStop])
    )
    assert (after.aborted_by or "").startswith(first or rule or "")


@pytest.mark.parametrize("reported", [LandingState.FLIP, None])
@pytest.mark.parametrize("first", [None, "before"])
def test_a_flip_has_its_time(reported: LandingState | None, first: str | None) -> None:
    state = replace(state_in(Phase.FLIPPING), aborted_by=first, link_lost=first)
    assert look(state, TIMING.flip_deadline, landing_state=reported) == (
        replace(state, time=TIMING.flip_deadline, gate=look(state, TIMING.flip_deadline)[0].gate),
        [],
    )
    after, ordered = look(state, nextafter(TIMING.flip_deadline, 9.0), landing_state=reported)
    assert (after.phase, ordered) == (Phase.STOPPING, [EmergencyStop])
    if reported is None:
        assert (after.aborted_by, after.link_lost) == (first, first or "no landing state during the flip")
    else:
        assert (after.aborted_by, after.link_lost) == (first or "flip_time: FLIP after 1 s, need CUT", first)


def test_a_flip_that_ends_waits_for_the_body_to_rest() -> None:
    after, ordered = look(state_in(Phase.FLIPPING), landing_state=LandingState.CUT)
    assert (after.phase, ordered, after.waiting_for) == (Phase.SETTLING, [], "the body to rest")


# --- settling ---------------------------------------------------------------------------------------------


def test_the_body_has_its_time_to_rest() -> None:
    state = state_in(Phase.SETTLING)
    early, ordered = look(state, nextafter(TIMING.settle, 0.0))
    assert (early.phase, ordered) == (Phase.SETTLING, [])
    after, ordered = look(state, TIMING.settle)
    assert (after.phase, ordered) == (Phase.DISARMING, [Disarm])


def hangs(distance: float, tilt: float) -> Observation:
    quaternion = INVERTED if tilt == 0.0 else turned(tilt=radians(180.0 - tilt))
    place = (0.0, 0.0, CEILING - distance)
    return replace(good_in(Phase.SETTLING), pose_position=place, pose_quaternion=quaternion)


@pytest.mark.parametrize(
    ("distance", "tilt", "words"),
    [
        (0.149, 0.0, None),
        (0.151, 0.0, "FALLING OR FALLEN: the drone is 0.15 m below the ceiling"),
        (0.6, 0.0, "FALLING OR FALLEN: the drone is 0.60 m below the ceiling"),
        (0.08, 9.99, None),
        (0.08, 10.01, "HALF ATTACHED: the drone hangs tilted by 10 deg; it may fall"),
        (0.08, 35.0, "HALF ATTACHED: the drone hangs tilted by 35 deg; it may fall"),
    ],
)
def test_the_operator_is_told_once_it_has_lasted(distance: float, tilt: float, words: str | None) -> None:
    o = hangs(distance, tilt)
    state, _ = step(state_in(Phase.SETTLING), Tick(o), 1.0, MISSION)
    assert state.alert is None
    state, _ = step(state, Tick(o), 1.0 + TIMING.hang_hold - 0.001, MISSION)
    assert state.alert is None
    state, _ = step(state, Tick(o), 1.0 + TIMING.hang_hold + 0.001, MISSION)
    assert state.alert == words


def test_at_the_very_edge_a_body_holds() -> None:
    low = SafetyLimits(room=RoomGeometry(ceiling_z=0.15))
    o = admit(replace(hangs(0.0, 0.0), pose_position=(0.0, 0.0, 0.0)), GateMemory(), low, 0.0)[0]
    assert does_not_hold(o, low) is None
    tilted = admit(hangs(0.08, 8.0), GateMemory(), low, 0.0)[0]
    assert tilted.pose_attitude is not None
    edge = SafetyLimits(hang_tilt=pi - tilted.pose_attitude.tilt)
    assert does_not_hold(tilted, edge) is None
    assert "HALF" in (does_not_hold(tilted, replace(edge, hang_tilt=nextafter(edge.hang_tilt, 0.0))) or "")
