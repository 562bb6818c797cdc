"""Which rule ends which phase, and how: one broken rule at a time."""

from dataclasses import replace
from math import radians
from typing import Any

import pytest

from mocap_bridge.health import PoseVerdict
from onboard.room import RoomGeometry
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import FlightState, Phase, SafetyLimits, Step, Tick, Timing, step
from perchhw.supervisor.events import Brake, Disarm, EmergencyStop, Land

from .simulated_attempt import FLYING, PERIOD, PLAN, turned
from .states import DESCENDING, HOVERING, good_in, mission_of, state_in

TUMBLED = SupervisorInfo(FLYING | SupervisorBits.TUMBLED)
NOT_FLYING = SupervisorInfo(SupervisorBits.ARMED | SupervisorBits.FLYING)

EVERYWHERE: dict[str, dict[str, Any]] = {
    "link_silence": {"link_silence": 0.51},
    "drone_state_age": {"drone_age": 0.26},
    "drone_state": {"drone": TUMBLED},
    "pose": {"pose_verdict": PoseVerdict.LOST},
    "pose_age": {"pose_age": 0.31},
    "estimate_age": {"estimate_age": 0.26},
    "battery_age": {"battery_age": 1.01},
    "battery_full": {"battery_voltage": 4.41},
}
ON_GROUND: dict[str, dict[str, Any]] = {
    **EVERYWHERE,
    "inside_room": {"pose_position": (2.01, 0.0, 0.07)},
    "tilt_on_ground": {"pose_quaternion": turned(tilt=radians(10.1))},
    "height_on_ground": {"pose_position": (-3.0, 0.0, 0.26)},
    "estimate_to_mocap": {"estimate_position": (-3.0, 0.06, 0.07)},
    "heading_to_mocap": {"estimate_quaternion": turned(yaw=radians(5.1))},
    "speed_on_ground": {"estimate_velocity": (0.0, 0.16, 0.0)},
    "battery_at_rest": {"battery_voltage": 3.79},
    "parameters": {"parameters_ok": False, "parameters_problem": "powerDist.idleThrust is 7000"},
}


def at(x: float, y: float, z: float, vx: float = 0.0, vy: float = 0.0, vz: float = 0.0) -> dict[str, Any]:
    place, velocity = (x, y, z), (vx, vy, vz)
    return {"pose_position": place, "estimate_position": place, "estimate_velocity": velocity}


IN_THE_AIR: dict[str, dict[str, Any]] = {
    **EVERYWHERE,
    "drone_can_fly": {"drone": NOT_FLYING},
    "inside_room": {**at(1.9, 0.0, 1.0), "pose_position": (2.01, 0.0, 1.0)},
    "estimate_to_mocap": {**at(-2.0, 0.0, 1.0), "pose_position": (-2.0, 0.26, 1.0)},
    "battery_in_flight": {"battery_voltage": 2.71},
    "fence_x_min": at(-6.0, 0.0, 1.0, vx=-2.2),
    "fence_x_max": at(1.5, 0.0, 1.0, vx=2.2),
    "fence_y_min": at(-2.0, -0.5, 1.0, vy=-2.2),
    "fence_y_max": at(-2.0, 0.5, 1.0, vy=2.2),
}
HOVER = {
    **IN_THE_AIR,
    "fence_ceiling": at(-2.0, 0.0, 1.6, vz=2.2),
    "tilt_in_hover": {"estimate_quaternion": turned(tilt=radians(35.1))},
    "speed_in_hover": at(-2.0, 0.0, 1.0, vx=2.51),
    "rates_age": {"rates_age": 0.26},
    "rotation_in_hover": {"body_rates": (0.0, 7.2, 7.2)},
}
FLOOR = {"fence_floor": at(-2.0, 0.0, 0.4, vz=-2.2)}
TEST_FLIGHT = {
    **IN_THE_AIR,
    **FLOOR,
    "fence_ceiling": at(-2.0, 0.0, 1.6, vz=2.2),
    "tilt_in_test_flight": {"estimate_quaternion": turned(tilt=radians(65.1))},
    "speed_in_test_flight": at(-6.0, 0.0, 1.0, vx=7.1),
    "rates_age": {"rates_age": 0.26},
    "rotation_in_test_flight": {"body_rates": (0.0, 0.0, 20.1)},
}
APPROACH = {
    **IN_THE_AIR,
    **FLOOR,
    "rates_age": {"rates_age": 0.26},
    "rotation_in_hover": {"body_rates": (10.1, 0.0, 0.0)},
    "landing_age": {"landing_age": 0.26},
    "landing_state": {"landing_state": 99},
    "corridor_distance": at(PLAN.x0, 0.61, PLAN.z0),
    "corridor_speed": at(*PLAN[:3], vy=1.21),
    "corridor_tilt": {"estimate_quaternion": turned(tilt=-radians(36.0))},
}
BROKEN = [
    (phase, rule, changes)
    for phases, rules in (
        ((Phase.UPLOADING, Phase.READY, Phase.ARMING), ON_GROUND),
        ((Phase.TAKING_OFF,), HOVER),
        ((Phase.MOVING_TO_START, Phase.ARMING_APPROACH), {**HOVER, **FLOOR}),
        ((Phase.TEST_FLIGHT,), TEST_FLIGHT),
        ((Phase.APPROACHING,), APPROACH),
    )
    for phase in phases
    for rule, changes in rules.items()
]
ANSWER = {
    Phase.UPLOADING: [],
    Phase.READY: [],
    Phase.ARMING: [Disarm],
    **{phase: [Land] for phase in HOVERING},
    Phase.APPROACHING: [Brake],
}


def tick(state: FlightState, now: float, limits: SafetyLimits | None = None, **changes: Any) -> Step:
    """One look at `now`, well but for `changes`."""
    o = replace(good_in(state.phase), **changes)
    return step(state, Tick(o), now, mission_of(state.phase), limits)


def ordered(result: Step) -> list[type]:
    return [type(order.command) for order in result.orders]


@pytest.mark.parametrize("phase", list(ANSWER))
def test_all_being_well_no_rule_speaks(phase: Phase) -> None:
    after = tick(state_in(phase), PERIOD)
    assert (after.state.phase, after.state.aborted_by, after.orders) == (phase, None, ())


@pytest.mark.parametrize(("phase", "rule", "changes"), BROKEN, ids=lambda v: v if isinstance(v, str) else "")
def test_a_broken_rule_ends_the_phase(phase: Phase, rule: str, changes: dict[str, Any]) -> None:
    after = tick(state_in(phase), PERIOD, **changes)
    assert (after.state.aborted_by or "").startswith(f"{rule}:")
    assert ordered(after) == ANSWER[phase]


CHECKED: dict[str, dict[str, Any]] = {**ON_GROUND, "drone_can_arm": {"drone": SupervisorInfo(0)}}


@pytest.mark.parametrize(("rule", "changes"), CHECKED.items(), ids=CHECKED)
def test_the_preflight_checks_wait_for_what_the_ground_demands(rule: str, changes: dict[str, Any]) -> None:
    state, orders = tick(state_in(Phase.CHECKING), PERIOD, **changes)
    assert state.waiting_for.startswith(f"{rule}:")
    assert orders == ()
    late, orders = tick(state, Timing().checks_deadline + 0.01, **changes)
    assert (late.phase, orders) == (Phase.DONE, ())
    assert (late.aborted_by or "").startswith(f"{rule}:")


@pytest.mark.parametrize("phase", [*HOVERING, Phase.APPROACHING])
def test_the_flight_as_a_whole_has_its_time(phase: Phase) -> None:
    mission = mission_of(phase)
    state = replace(state_in(phase), airborne_since=-SafetyLimits().flight_time - mission.approach_duration)
    assert tick(state, 0.0).state.aborted_by is None
    late = tick(state, 0.01)
    assert (late.state.aborted_by or "").startswith("flight_time:")
    assert ordered(late) == ANSWER[phase]


def test_a_full_battery_is_not_overfull() -> None:
    for phase in (Phase.UPLOADING, Phase.MOVING_TO_START, Phase.APPROACHING):
        assert tick(state_in(phase), PERIOD, battery_voltage=4.35).state.aborted_by is None
        assert tick(state_in(phase), PERIOD, battery_voltage=4.41).state.aborted_by is not None


def test_one_low_sample_of_the_battery_lands_nothing_but_a_low_battery_does() -> None:
    state, now = state_in(Phase.MOVING_TO_START), 0.0
    for _ in range(10):
        now += PERIOD
        state, _ = tick(state, now)
    state, orders = tick(state, now + PERIOD, battery_voltage=2.5)
    assert orders == ()
    for count in range(40):
        state, orders = tick(state, now + PERIOD * (count + 2), battery_voltage=2.5)
        if orders:
            break
    assert [type(o.command) for o in orders] == [Land]
    assert 0.2 < PERIOD * (count + 2) < 0.4, "3.4 V falls to 2.72 by a low-pass of 0.2 s"


def test_a_tilted_ceiling_is_a_nearer_one() -> None:
    flat, tilted = SafetyLimits(), SafetyLimits(room=RoomGeometry(ceiling_tilt_x=radians(10.0)))
    state = state_in(Phase.MOVING_TO_START)
    along, hover = at(-1.0, 0.0, 1.905, vx=-1.0), at(-1.0, 0.0, 1.905)
    assert tick(state, PERIOD, flat, **along).state.aborted_by is None
    assert tick(state, PERIOD, tilted, **hover).state.aborted_by is None
    assert (tick(state, PERIOD, tilted, **along).state.aborted_by or "").startswith("fence_ceiling")


def test_the_floor_is_where_the_room_has_it() -> None:
    lowered = SafetyLimits(room=RoomGeometry(floor_z=-2.0))
    below = at(-1.0, 0.0, -1.0)
    for phase in (Phase.MOVING_TO_START, Phase.TEST_FLIGHT):
        assert tick(state_in(phase), PERIOD, lowered, **below).state.aborted_by is None
    hovers = at(-1.0, 0.0, 0.2)
    before = -Timing().land
    landing = replace(state_in(Phase.LANDING), entered_at=before, answered_at=before)
    assert ordered(tick(landing, 0.0, lowered, **hovers)) == []
    assert ordered(tick(landing, 0.0, **hovers)) == [Disarm]
    stands = at(-3.0, 0.0, -1.93)
    assert tick(state_in(Phase.UPLOADING), PERIOD, lowered, **stands).state.aborted_by is None


@pytest.mark.parametrize(
    ("changes", "rule"),
    [({"pose_position": (-2.7, 0.0, 0.07)}, "start_mark_distance"), ({}, "start_mark_heading")],
)
def test_a_drone_beside_its_mark_does_not_arm(changes: dict[str, Any], rule: str) -> None:
    heading = radians(16.0) if rule == "start_mark_heading" else 0.0
    marked = SafetyLimits(start_mark=(-3.0, 0.0, heading), disagreement_on_ground=1.0)
    assert rule in tick(state_in(Phase.CHECKING), PERIOD, marked, **changes).state.waiting_for
    assert rule not in tick(state_in(Phase.CHECKING), PERIOD, SafetyLimits(), **changes).state.waiting_for


# --- the descent ------------------------------------------------------------------------------------------

FALLING_OUT: dict[str, dict[str, Any]] = {
    "link_silence": {"link_silence": 1.01},
    "drone_state_age": {"drone_age": 1.01},
    "descent_estimate": {"estimate_velocity": None},
    "descent_disagreement": {"estimate_position": (-3.0, 0.9, 2.0), "pose_position": (-3.0, 0.0, 1.5)},
    "descent_speed": {"estimate_velocity": (0.0, 0.0, -4.1)},
    "descent_speed_blind": {"pose_position": None, "estimate_velocity": (0.0, 0.0, -4.1)},
    "descent_rotation": {"body_rates": (0.0, 14.2, 14.2)},
    "descent_tilt": {"estimate_quaternion": turned(tilt=radians(75.1))},
    "descent_beyond_walls": {"pose_position": (-3.0, 1.26, 1.0), "estimate_position": (-3.0, 0.9, 1.0)},
}


@pytest.mark.parametrize("phase", DESCENDING)
@pytest.mark.parametrize(("rule", "changes"), FALLING_OUT.items(), ids=FALLING_OUT)
def test_a_descent_out_of_control_is_stopped_when_it_lasts(
    phase: Phase, rule: str, changes: dict[str, Any]
) -> None:
    hold = Timing().stop_hold
    first = tick(state_in(phase), PERIOD, **changes)
    assert first.orders == ()
    before = tick(first.state, PERIOD + hold - 0.001, **changes)
    assert before.orders == ()
    after = tick(before.state, PERIOD + hold, **changes)
    assert ordered(after) == [EmergencyStop]
    assert after.state.phase is Phase.STOPPING
    assert (after.state.aborted_by or "").startswith(f"{rule}:")
    recovered = tick(before.state, PERIOD + hold)
    assert recovered.orders == ()
    assert recovered.state.bad_since is None


@pytest.mark.parametrize(("rule", "changes"), FALLING_OUT.items(), ids=FALLING_OUT)
def test_a_landing_from_a_course_keeps_the_same_rules_but_that_of_its_speed(
    rule: str, changes: dict[str, Any]
) -> None:
    o, state = replace(good_in(Phase.LANDING), **changes), state_in(Phase.LANDING)
    for now in (PERIOD, PERIOD + Timing().stop_hold):
        state, orders = step(state, Tick(o), now, mission_of(Phase.TEST_FLIGHT))
    stopped = [type(order.command) for order in orders] == [EmergencyStop]
    assert stopped == (rule not in ("descent_speed", "descent_speed_blind"))


@pytest.mark.parametrize("phase", DESCENDING)
@pytest.mark.parametrize(
    "changes",
    [
        {"pose_verdict": PoseVerdict.LOST, "pose_age": 5.0},
        {"estimate_age": 0.9},
        {"link_silence": 0.9, "drone_age": 0.9, "estimate_age": 0.9, "pose_age": 2.0},
        {"estimate_position": (-3.0, 0.5, 1.0), "pose_position": (-3.0, 0.0, 1.0)},
        {"battery_voltage": 2.5},
        {"estimate_velocity": (0.0, 0.0, -3.0)},
        {"rates_age": 0.9, "body_rates": None},
        {"body_rates": (0.0, 17.0, 0.0)},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_a_descent_that_may_still_go_well_is_left_alone(phase: Phase, changes: dict[str, Any]) -> None:
    state = state_in(phase)
    for count in range(1, 50):
        state, orders = tick(state, count * PERIOD, **changes)
        assert orders == ()
