"""Whatever a value turns into, in every phase the machine answers as if it did not know it."""

from dataclasses import fields, replace
from math import inf, nan
from typing import Any, cast

import pytest

from onboard.app_interface import LandingState
from onboard.supervisor_info import SupervisorInfo
from perchhw.supervisor import Observation, Phase, SafetyLimits, Step, Tick, Timing, step
from perchhw.supervisor.events import Arm, Brake, Disarm, EmergencyStop, Land
from perchhw.supervisor.gate import GateMemory, admit

from .simulated_attempt import FLYING, PERIOD, turned
from .states import ALL_PHASES, HOVERING, good_in, mission_of, state_in

NUMBERS = {"link_silence", "battery_voltage"}
AGES = {n.name for n in fields(Observation) if n.name.endswith("_age")}
VECTORS = {"pose_position", "estimate_position", "estimate_velocity", "body_rates"}
QUATERNIONS = {"pose_quaternion", "estimate_quaternion"}
KINDS = {"pose_verdict", "landing_state", "end_reason"}
COUNTS = {"active_policy_crc", "trigger_count"}
SWITCHES = {"policy_armed", "trajectory_armed", "parameters_ok"}
WORDS = {"pose_problem", "parameters_problem"}
"""Told to the operator; no rule reads them."""


def bad_values(name: str) -> dict[str, Any]:
    """Values of a field that must count as unknown, by what is wrong with them: none is legal."""
    bad: dict[str, Any] = {"none": None}
    if name in NUMBERS | AGES:
        bad |= {
            "nan": nan,
            "inf": inf,
            "negative": -0.001,
            "absurd": 99.0 if name == "battery_voltage" else 1e5,
        }
        bad |= {"text": "0.1", "boolean": True}
    if name == "battery_voltage":
        bad |= {"zero": 0.0, "99 V": 99.0}
    if name in AGES:
        bad["stale"] = 1.5
    if name in VECTORS:
        bad |= {
            "nan": (0.0, nan, 0.0),
            "inf": (0.0, 0.0, -inf),
            "absurd": (0.0, 1e6, 0.0),
            "short": (0.0, 0.0),
            "long": (0.0, 0.0, 0.0, 0.0),
            "list": [0.0, 0.0, 0.0],
            "number": 0.0,
            "text": "000",
            "texts": ("0", "0", "0"),
            "booleans": (False, False, False),
        }
    if name in QUATERNIONS:
        bad |= {"nan": (nan, 0.0, 0.0, 1.0), "inf": (0.0, 0.0, 0.0, inf), "zero": (0.0, 0.0, 0.0, 0.0)}
        bad |= {"absurd": (0.0, 0.0, 0.0, 1.1), "negative": (0.0, 0.0, 0.0, -0.9), "short": (0.0, 0.0, 1.0)}
        bad |= {"list": [0.0, 0.0, 0.0, 1.0], "number": 1.0, "text": "0001"}
        bad |= {"texts": ("0", "0", "0", "1"), "booleans": (False, False, False, True)}
    if name in KINDS:
        bad |= {
            "nan": nan,
            "inf": inf,
            "absurd": 99,
            "negative": -1,
            "zero": 0,
            "text": "OK",
            "boolean": True,
        }
    if name in COUNTS:
        bad |= {"nan": nan, "inf": inf, "negative": -1, "absurd": 2**40, "text": "0", "boolean": True}
        bad |= {"float": 0.0}
    if name in SWITCHES:
        bad |= {"nan": nan, "inf": inf, "negative": -1, "absurd": 7, "zero": 0, "one": 1, "text": "False"}
    if name == "drone":
        bad |= {"negative": SupervisorInfo(-1), "absurd": SupervisorInfo(2**20), "nan": nan, "inf": inf}
        bad |= {"zero": 0, "number": int(FLYING), "text": "flying", "boolean": True}
    return bad


CASES = [
    (field.name, kind, value)
    for field in fields(Observation)
    if field.name not in WORDS
    for kind, value in bad_values(field.name).items()
]

LINK_AND_DRONE = {"link_silence", "drone", "drone_age"}
POSE = {"pose_verdict", "pose_age", "pose_position"}
ESTIMATE = {"estimate_age", "estimate_position", "estimate_velocity", "estimate_quaternion"}
BATTERY = {"battery_voltage", "battery_age"}
RATES = {"rates_age", "body_rates"}
POLICY = {"active_policy_crc", "policy_crc_age"}
ARMED = {"landing_state", "landing_age", "trigger_count", "policy_armed", "trajectory_armed"}

GROUND = LINK_AND_DRONE | POSE | {"pose_quaternion"} | ESTIMATE | BATTERY | {"parameters_ok"}
AIR = LINK_AND_DRONE | POSE | ESTIMATE | BATTERY | RATES
DENIED_AT_ONCE: dict[Phase, set[str]] = {
    **dict.fromkeys(HOVERING, AIR),
    Phase.UPLOADING: GROUND,
    Phase.READY: GROUND,
    Phase.ARMING: GROUND,
    Phase.ARMING_APPROACH: AIR | POLICY,
    Phase.APPROACHING: AIR | {"landing_state", "landing_age"},
}
"""Fields whose loss ends a phase at once."""
STOPPED_WHEN_IT_LASTS = {"link_silence", "drone_age", "body_rates"} | ESTIMATE
"""Fields whose loss ends a descent after a while."""
ANSWER: dict[Phase, list[type]] = {
    **{phase: [Land] for phase in HOVERING},
    Phase.UPLOADING: [],
    Phase.READY: [],
    Phase.ARMING: [Disarm],
    Phase.APPROACHING: [Brake],
}


def look(phase: Phase, name: str, value: Any) -> Step:
    o = replace(good_in(phase), **{name: value})
    return step(state_in(phase), Tick(o), PERIOD, mission_of(phase))


def test_every_field_is_named_here() -> None:
    known = NUMBERS | AGES | VECTORS | QUATERNIONS | KINDS | COUNTS | SWITCHES | WORDS | {"drone"}
    assert known == {field.name for field in fields(Observation)}


@pytest.mark.parametrize(("name", "kind", "value"), CASES, ids=lambda v: v if isinstance(v, str) else "")
def test_what_is_bad_is_unknown(name: str, kind: str, value: Any) -> None:
    bad = replace(good_in(Phase.APPROACHING), **{name: value})
    admitted, _ = admit(bad, GateMemory(), SafetyLimits(), 0.0)
    if kind != "stale":
        assert getattr(admitted, name) is None
    owned = {
        "pose_age": ("pose_position", "pose_quaternion"),
        "estimate_age": ("estimate_position", "estimate_velocity", "estimate_quaternion"),
        "rates_age": ("body_rates",),
        "drone_age": ("drone",),
        "battery_age": ("battery_voltage",),
        "landing_age": ("landing_state", "end_reason", "trigger_count"),
        "policy_crc_age": ("active_policy_crc",),
    }
    for value_name in owned.get(name, ()):
        assert getattr(admitted, value_name) is None


@pytest.mark.parametrize("phase", ALL_PHASES)
@pytest.mark.parametrize("name", sorted({name for name, _, _ in CASES}))
def test_every_phase_answers_to_every_bad_value(phase: Phase, name: str) -> None:
    for value in bad_values(name).values():
        answers_as_to_the_unknown(phase, name, value)


def answers_as_to_the_unknown(phase: Phase, name: str, value: Any) -> None:
    after = look(phase, name, value)
    ordered = [type(order.command) for order in after.orders]
    if name in DENIED_AT_ONCE.get(phase, ()):
        assert after.state.aborted_by is not None
        assert ordered == ANSWER[phase]
        return
    # Nothing at once: no phase moves on by what it does not know.
    assert after.state.phase is phase
    assert ordered == []
    state, now, denied = after.state, PERIOD, Step(after.state)
    o = replace(good_in(phase), **{name: value})
    while now < Timing().stop_hold + 0.1 and not denied.orders:
        now += PERIOD
        denied = step(denied.state, Tick(o), now, mission_of(phase))
    if phase in (Phase.BRAKING, Phase.LANDING) and name in STOPPED_WHEN_IT_LASTS:
        assert [type(order.command) for order in denied.orders] == [EmergencyStop]
    elif phase is Phase.CHECKING and name in GROUND:
        assert denied.state.phase is phase
    elif phase is Phase.SETTLING and name in {"pose_age", "pose_position", "pose_quaternion"}:
        assert "NOT SEEN" in (denied.state.alert or "")
    else:
        assert not {EmergencyStop, Arm} & {type(order.command) for order in denied.orders}
        assert state.alert is None


@pytest.mark.parametrize("name", sorted(ARMED))
def test_an_approach_does_not_start_by_what_is_not_known(name: str) -> None:
    armed = replace(state_in(Phase.ARMING_APPROACH), answered_at=0.0)
    ready = replace(
        good_in(Phase.ARMING_APPROACH),
        landing_state=LandingState.TRAJECTORY_ARMED,
        policy_armed=True,
        trajectory_armed=True,
    )
    mission = mission_of(Phase.ARMING_APPROACH)
    assert step(armed, Tick(ready), PERIOD, mission).state.phase is Phase.APPROACHING
    unanswered = replace(armed, answered_at=None)
    assert step(unanswered, Tick(ready), PERIOD, mission).state.phase is Phase.ARMING_APPROACH
    for value in bad_values(name).values():
        o = replace(ready, **{name: value})
        assert step(armed, Tick(o), PERIOD, mission).state.phase is Phase.ARMING_APPROACH
    if name in SWITCHES:
        o = replace(ready, **{name: False})
        assert step(armed, Tick(o), PERIOD, mission).state.phase is Phase.ARMING_APPROACH


def test_what_is_good_passes_unchanged() -> None:
    for phase in ALL_PHASES:
        o = good_in(phase)
        assert admit(o, GateMemory(), SafetyLimits(), 0.0)[0] == o


def test_attitude_passes_with_either_sign_and_the_rounding_of_a_log() -> None:
    x, y, z, w = turned(tilt=0.4, yaw=1.0)
    for quaternion in ((-x, -y, -z, -w), tuple(1.005 * part for part in (x, y, z, w))):
        o = replace(good_in(Phase.LANDING), estimate_quaternion=cast(Any, quaternion))
        attitude = admit(o, GateMemory(), SafetyLimits(), 0.0)[0].estimate_attitude
        assert attitude is not None
        assert attitude.tilt == pytest.approx(0.4)
        assert attitude.yaw == pytest.approx(1.0)


def test_the_battery_is_low_passed_and_starts_afresh_after_a_gap() -> None:
    limits, memory = SafetyLimits(), GateMemory()

    def seen(voltage: float | None, now: float) -> float | None:
        nonlocal memory
        o = replace(good_in(Phase.LANDING), battery_voltage=voltage)
        admitted, memory = admit(o, memory, limits, now)
        return admitted.battery_voltage

    assert seen(4.0, 0.0) == 4.0
    assert seen(3.0, limits.battery_filter) == pytest.approx(4.0 - (1.0 - 1.0 / 2.718281828), abs=1e-6)
    assert seen(None, 0.3) is None
    assert seen(3.2, 0.4) == 3.2
