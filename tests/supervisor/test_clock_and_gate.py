"""A clock that cannot say, and the edges of what the gate admits."""

from dataclasses import replace
from math import cos, inf, nan, nextafter, pi, sin
from typing import Any, cast

import pytest

from mocap_bridge.health import PoseVerdict
from onboard.app_interface import EndReason, LandingState
from onboard.supervisor_info import SupervisorInfo
from perchhw.supervisor import (
    InternalError,
    Observation,
    OperatorAbort,
    Phase,
    SafetyLimits,
    StopConfirmed,
    Tick,
    Timing,
    initial_state,
    step,
)
from perchhw.supervisor.events import Disarm, EmergencyStop, Land
from perchhw.supervisor.gate import GateMemory, admit
from perchhw.supervisor.observation import Attitude

from .simulated_attempt import CRC, MISSION, PERIOD, good_on_ground
from .states import ALL_PHASES, good_in, mission_of, state_in

LIMITS, TIMING = SafetyLimits(), Timing()

# --- the clock --------------------------------------------------------------------------------------------


def test_an_attempt_begins_with_the_checks_and_knows_nothing() -> None:
    state = initial_state(3.0)
    assert (state.phase, state.entered_at, state.waiting_for) == (
        Phase.CHECKING,
        3.0,
        "the preflight checks",
    )
    assert (state.orders_given, state.oldest_in_force, state.triggers_before) == (0, 1, 0)
    flags = (state.arm_ordered, state.armed, state.approach_ordered, state.triggered)
    assert flags == (False, False, False, False)


@pytest.mark.parametrize("reading", [nan, inf, -inf])
def test_a_clock_that_reads_no_number_counts_a_tick(reading: float) -> None:
    state = replace(state_in(Phase.LANDING), time=1.0)
    after, orders = step(state, Tick(good_in(Phase.LANDING)), reading, MISSION)
    assert (after.time, after.clock_shift, orders) == (1.02, 0.0, ())
    assert after.aborted_by == f"internal_error: the clock reads {reading}"
    begun, _ = step(replace(state, time=-inf, entered_at=0.5), Tick(good_in(Phase.LANDING)), reading, MISSION)
    assert begun.time == 0.52


def test_a_clock_that_was_set_back_goes_on_from_where_it_was() -> None:
    state = replace(state_in(Phase.LANDING), time=1.0)
    after, _ = step(state, Tick(good_in(Phase.LANDING)), -4.0, MISSION)
    assert after.aborted_by == "internal_error: the clock ran back by 5 s"
    assert after.time == 1.02
    later, _ = step(replace(after, aborted_by=None), Tick(good_in(Phase.LANDING)), -3.5, MISSION)
    assert later.time == pytest.approx(1.52)
    assert later.aborted_by is None
    again, _ = step(later, Tick(good_in(Phase.LANDING)), -5.0, MISSION)
    assert again.aborted_by == "internal_error: the clock ran back by 1.5 s"
    assert again.time == pytest.approx(1.54)


def test_the_same_time_twice_is_no_fault_of_the_clock() -> None:
    state = replace(state_in(Phase.LANDING), time=1.0)
    assert step(state, Tick(good_in(Phase.LANDING)), 1.0, MISSION).state.aborted_by is None


@pytest.mark.parametrize("phase", ALL_PHASES)
@pytest.mark.parametrize("by_the_clock", [True, False])
def test_an_error_of_ours_does_not_hide_an_earlier_reason(phase: Phase, by_the_clock: bool) -> None:
    state = replace(state_in(phase), time=1.0, aborted_by="pose: LOST")
    if by_the_clock:
        after, _ = step(state, Tick(good_in(phase)), -1.0, mission_of(phase))
    else:
        after, _ = step(state, InternalError("OSError"), 1.1, mission_of(phase))
    assert after.aborted_by == "pose: LOST"


def test_a_stop_that_a_bad_clock_caused_is_not_confirmed_by_what_came_before_it() -> None:
    lost = replace(state_in(Phase.LANDING), time=5.0, bad_since=0.0)
    state, orders = step(lost, StopConfirmed(), -1.0, MISSION)
    assert state.phase is Phase.STOPPING
    assert [type(order.command) for order in orders] == [EmergencyStop]
    stopping = replace(state_in(Phase.STOPPING), time=5.0)
    assert step(stopping, StopConfirmed(), -1.0, MISSION).state.phase is Phase.DONE


@pytest.mark.parametrize(
    ("phase", "first"), [(Phase.TAKING_OFF, Land), (Phase.ARMING, Disarm), (Phase.LANDING, None)]
)
def test_what_happens_while_the_clock_is_bad_still_counts(phase: Phase, first: type | None) -> None:
    state = replace(state_in(phase), time=5.0)
    state, orders = step(state, OperatorAbort(urgent=True), -1.0, mission_of(phase))
    assert [type(order.command) for order in orders] == [*([first] if first else []), EmergencyStop]
    assert state.phase is Phase.STOPPING


def test_the_machine_keeps_the_times_and_limits_that_it_is_given() -> None:
    timing = Timing(land=9.0)
    _, (order,) = step(state_in(Phase.TAKING_OFF), OperatorAbort(), 0.1, MISSION, timing=timing)
    assert order.command == Land(9.0)
    strict = SafetyLimits(link_silence=0.005)
    after, _ = step(state_in(Phase.TAKING_OFF), Tick(good_in(Phase.TAKING_OFF)), 0.1, MISSION, strict)
    assert (after.aborted_by or "").startswith("link_silence")


def test_a_stop_that_is_confirmed_tells_nothing_and_aborts_nothing() -> None:
    after, orders = step(state_in(Phase.STOPPING), StopConfirmed(), 0.1, MISSION)
    assert (after.phase, orders, after.alert, after.aborted_by) == (Phase.DONE, (), None, None)


# --- checking ---------------------------------------------------------------------------------------------


def test_checks_that_pass_late_have_passed() -> None:
    late = TIMING.checks_deadline + 1.0
    state, orders = step(state_in(Phase.CHECKING), Tick(good_in(Phase.CHECKING)), late, MISSION)
    assert (state.phase, orders, state.aborted_by) == (Phase.CHECKING, (), None)
    assert (state.good_since, state.waiting_for) == (late, "the preflight checks")


@pytest.mark.parametrize("hold", [TIMING.checks_hold])
def test_checks_pass_once_they_have_held(hold: float) -> None:
    state = replace(state_in(Phase.CHECKING), good_since=0.0)
    o = Tick(good_in(Phase.CHECKING))
    assert step(state, o, nextafter(hold, 0.0), MISSION).state.phase is Phase.CHECKING
    after, orders = step(state, o, hold, MISSION)
    assert (after.phase, after.waiting_for) == (Phase.UPLOADING, "the policy upload")
    assert len(orders) == 1


# --- the gate ---------------------------------------------------------------------------------------------

FULL = replace(
    good_on_ground(), end_reason=EndReason.OFF_TRACK, landing_state=LandingState.BRAKE, trigger_count=3
)


def admitted(now: float = 0.0, memory: GateMemory | None = None, **changes: Any) -> Observation:
    return admit(replace(FULL, **changes), memory or GateMemory(), LIMITS, now)[0]


OWNED = {
    "pose_age": (LIMITS.pose_age_bridged, ("pose_position", "pose_quaternion")),
    "estimate_age": (
        LIMITS.telemetry_age,
        ("estimate_position", "estimate_velocity", "estimate_quaternion"),
    ),
    "rates_age": (LIMITS.telemetry_age, ("body_rates",)),
    "drone_age": (LIMITS.telemetry_age, ("drone",)),
    "battery_age": (LIMITS.battery_age, ("battery_voltage",)),
    "landing_age": (LIMITS.telemetry_age, ("landing_state", "end_reason", "trigger_count")),
    "policy_crc_age": (LIMITS.telemetry_age, ("active_policy_crc",)),
}


@pytest.mark.parametrize("name", list(OWNED))
def test_values_are_admitted_up_to_their_age_and_not_beyond(name: str) -> None:
    limit, values = OWNED[name]

    def aged(age: float, value: str) -> Any:
        changes: dict[str, Any] = {name: age}
        return getattr(admitted(**changes), value)

    for value in values:
        assert aged(0.0, value) is not None
        assert aged(limit, value) is not None
        assert aged(nextafter(limit, inf), value) is None
    assert aged(3600.0, name) == 3600.0
    assert aged(3600.01, name) is None
    assert aged(-1e-9, name) is None


EDGES: list[tuple[str, Any, Any]] = [
    ("link_silence", 0.0, -1e-9),
    ("link_silence", 3600.0, 3600.01),
    *(
        (name, tuple(largest if at == part else 0.0 for part in range(3)), outside)
        for name, largest in (
            ("pose_position", 50.0),
            ("estimate_position", -50.0),
            ("estimate_velocity", 20.0),
            ("body_rates", -40.0),
        )
        for at in range(3)
        for outside in (tuple(1.0001 * largest if at == part else 0.0 for part in range(3)),)
    ),
    ("estimate_position", (0.0, 0.0, 1.0), (0.0, 0.0, nan, 1.0)),
    ("estimate_position", (0, 0, 1), [0.0, 0.0, 1.0]),
    ("pose_position", (0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0)),
    ("pose_quaternion", (0.0, 0.0, 0.0, -1.0099), (0.0, 0.0, 0.0, -1.0101)),
    ("estimate_quaternion", (0.0, 0.9901, 0.0, 0.0), (0.0, 0.9899, 0.0, 0.0)),
    ("battery_voltage", 2.0, 1.999),
    ("battery_voltage", 4.5, 4.501),
    ("battery_voltage", 4, True),
    ("trigger_count", 0, -1),
    ("trigger_count", 255, 256),
    ("trigger_count", 1, True),
    ("trigger_count", 1, 1.0),
    ("active_policy_crc", 2**32 - 1, 2**32),
    ("active_policy_crc", CRC, float(CRC)),
    ("drone", SupervisorInfo(2**16 - 1), SupervisorInfo(2**16)),
    ("drone", SupervisorInfo(0), SupervisorInfo(-1)),
    ("drone", SupervisorInfo(0), 0),
    ("pose_verdict", PoseVerdict.LOST, 3),
    ("end_reason", EndReason.NONE, 0),
    ("landing_state", LandingState.IDLE, EndReason.NONE),
    ("policy_armed", True, 1),
    ("trajectory_armed", False, 0),
    ("parameters_ok", True, "True"),
]


@pytest.mark.parametrize(("name", "inside", "outside"), EDGES, ids=[edge[0] for edge in EDGES])
def test_the_gate_has_its_edges(name: str, inside: Any, outside: Any) -> None:
    assert getattr(admitted(**{name: inside}), name) == inside
    assert getattr(admitted(**{name: outside}), name) is None


def test_the_filter_of_the_battery_knows_no_time_before_the_last() -> None:
    memory = GateMemory(4.0, 1.0)
    assert admitted(0.9, memory, battery_voltage=3.0).battery_voltage == 4.0
    assert admitted(1.0, memory, battery_voltage=3.0).battery_voltage == 4.0
    later, kept = admit(replace(FULL, battery_voltage=3.0), memory, LIMITS, 1.0 + LIMITS.battery_filter)
    assert later.battery_voltage == pytest.approx(3.0 + 0.36788, abs=1e-5)
    assert kept.battery_time == 1.0 + LIMITS.battery_filter


def test_a_body_that_is_upside_down_to_the_last_digit_has_a_tilt() -> None:
    for count in range(2000):
        angle = 2.0 * pi * count / 2000.0
        attitude = Attitude.from_quaternion((cos(angle), sin(angle), 0.0, 0.0))
        assert attitude is not None
        assert attitude.tilt == pytest.approx(pi, abs=1e-7)


def test_an_attitude_is_that_of_the_rotation_of_unit_length() -> None:
    for scale in (0.991, 1.0, 1.009):
        quaternion = tuple(scale * part for part in (0.1, -0.3, 0.5, 0.65**0.5))
        attitude = Attitude.from_quaternion(cast(Any, quaternion))
        assert attitude is not None
        assert cos(attitude.tilt) == pytest.approx(1.0 - 2.0 * (0.01 + 0.09))
        assert attitude.yaw == pytest.approx(1.16569, abs=1e-5)


def test_a_phase_is_looked_at_with_what_the_gate_remembers() -> None:
    state, now = state_in(Phase.MOVING_TO_START), 0.0
    for voltage in (3.4, 3.2):
        now += PERIOD
        state, _ = step(state, Tick(replace(good_in(state.phase), battery_voltage=voltage)), now, MISSION)
    assert 3.35 < (state.gate.battery_voltage or 0.0) < 3.4
    assert state.gate.battery_time == now
