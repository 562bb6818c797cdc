"""Motors that are cut before the drone is down, by the drone or by the host: told at once, and remembered."""

from dataclasses import replace
from typing import Any

import pytest

from onboard.app_interface import EndReason, LandingState
from onboard.supervisor_info import SupervisorBits, SupervisorInfo
from perchhw.supervisor import CommandFailed, FlightState, LinkDown, Order, Phase, Tick, Timing, step
from perchhw.supervisor.events import Brake, Disarm, EmergencyStop, Land

from .simulated_attempt import FLYING, MISSION, PERIOD
from .states import ALL_PHASES, BEFORE_ARMING, DESCENDING, HOVERING, good_in, mission_of, state_in

TOLD = "MOTORS CUT BEFORE IT WAS DOWN: {}; a drone in the air has fallen"
FAULT = TOLD.format("the drone did it by itself, its estimate cannot be true any more (FAULT)")
CUT = TOLD.format("the drone did it by itself, it met the ceiling, or was tilted by more than 70 deg (CUT)")
ENDED = TOLD.format("the drone did it by itself, its supervisor ended the flight (CUT)")


def look(state: FlightState, now: float = PERIOD, **changes: Any) -> tuple[FlightState, list[type]]:
    """The state after one look, well but for `changes`, and what was ordered."""
    after, orders = step(state, Tick(replace(good_in(state.phase), **changes)), now, mission_of(state.phase))
    return after, [type(order.command) for order in orders]


@pytest.mark.parametrize("phase", DESCENDING)
@pytest.mark.parametrize(
    ("reported", "reason", "told"),
    [
        (LandingState.FAULT, EndReason.POSE_LOST, FAULT),
        (LandingState.FAULT, EndReason.NOT_FLYING, FAULT),
        (LandingState.CUT, EndReason.POSE_LOST, CUT),
        (LandingState.CUT, None, CUT),
        (LandingState.CUT, EndReason.NOT_FLYING, ENDED),
    ],
)
def test_a_drone_that_cuts_its_motors_in_a_descent_is_told(
    phase: Phase, reported: LandingState, reason: EndReason | None, told: str
) -> None:
    state = replace(state_in(phase), aborted_by="drone_broke_off: pose_lost")
    after, _ = look(state, landing_state=reported, end_reason=reason)
    assert after.phase is (Phase.SETTLING if phase is Phase.BRAKING else Phase.DISARMING)
    assert (after.alert, after.fell) == (told, told)
    assert after.aborted_by == "drone_broke_off: pose_lost"


@pytest.mark.parametrize(
    ("reason", "told"),
    [(EndReason.TILT, CUT), (EndReason.CONTACT, CUT), (EndReason.NOT_FLYING, ENDED), (None, CUT)],
)
def test_an_approach_that_is_cut_without_a_trigger_is_told(reason: EndReason | None, told: str) -> None:
    state = replace(state_in(Phase.APPROACHING), triggers_before=3)
    changes: dict[str, Any] = {"landing_state": LandingState.CUT, "end_reason": reason}
    after, _ = look(state, trigger_count=3, **changes)
    assert (after.phase, after.alert, after.fell) == (Phase.SETTLING, told, told)
    later, _ = look(after, 1.0, pose_position=(0.0, 0.0, 0.1))
    assert (later.phase, later.alert, later.fell) == (Phase.SETTLING, told, told)
    landed, _ = look(state, trigger_count=4, **changes)
    assert (landed.phase, landed.alert, landed.fell) == (Phase.SETTLING, None, None)


def test_a_fault_on_the_approach_is_told() -> None:
    state, ordered = look(state_in(Phase.APPROACHING), landing_state=LandingState.FAULT)
    assert (state.phase, ordered) == (Phase.BRAKING, [Brake])
    state, _ = look(state, 2 * PERIOD, landing_state=LandingState.FAULT)
    assert (state.phase, state.alert) == (Phase.SETTLING, FAULT)


@pytest.mark.parametrize("phase", DESCENDING)
@pytest.mark.parametrize("first", [None, "pose: LOST"])
def test_a_host_that_stops_a_descent_says_why(phase: Phase, first: str | None) -> None:
    state = replace(state_in(phase), aborted_by=first, bad_since=0.0)
    after, ordered = look(state, 0.4, link_silence=1.5)
    why = "link_silence: 1.5 s, need at most 1 s"
    assert ordered == [EmergencyStop]
    assert after.aborted_by == (first or why)
    assert after.alert == after.fell == TOLD.format(f"the host did it ({why})")


@pytest.mark.parametrize(
    ("phase", "command", "told"),
    [
        (Phase.BRAKING, Brake(), TOLD.format("the host did it (Brake failed: no answer)")),
        (Phase.LANDING, Land(3.5), TOLD.format("the host did it (Land failed: no answer)")),
        (Phase.DISARMING, Disarm(), None),
    ],
)
def test_an_order_that_fails_in_a_descent_stops_it_and_says_so(
    phase: Phase, command: Any, told: str | None
) -> None:
    """Disarming, the drone is down, or hangs."""
    after, orders = step(state_in(phase), CommandFailed(Order(7, command), "no answer"), PERIOD, MISSION)
    assert [type(order.command) for order in orders] == [EmergencyStop]
    assert (after.alert, after.fell) == (told, told)


@pytest.mark.parametrize("phase", DESCENDING)
@pytest.mark.parametrize("reported", [None, *LandingState])
def test_nothing_else_is_told(phase: Phase, reported: LandingState | None) -> None:
    after, _ = look(state_in(phase), landing_state=reported)
    assert (after.fell is not None) == (reported in (LandingState.CUT, LandingState.FAULT))
    assert after.alert == after.fell


TUMBLED = SupervisorInfo(FLYING & ~SupervisorBits.CAN_FLY | SupervisorBits.TUMBLED)
CRASHED = SupervisorInfo(FLYING & ~SupervisorBits.CAN_FLY | SupervisorBits.CRASHED)
FALLS = SupervisorInfo(FLYING & ~SupervisorBits.CAN_FLY)
ELSEWHERE = TOLD.format("somebody else stopped the drone, or its own supervisor did")
LIES = TOLD.format("the drone's own supervisor did it, it lies or tumbles")


@pytest.mark.parametrize(("drone", "told"), [(FALLS, ELSEWHERE), (TUMBLED, LIES), (CRASHED, LIES)])
@pytest.mark.parametrize("phase", [*HOVERING, Phase.APPROACHING, *DESCENDING])
def test_a_drone_whose_supervisor_cuts_its_motors_in_the_air_is_told(
    phase: Phase, drone: SupervisorInfo, told: str
) -> None:
    after, _ = look(state_in(phase), drone=drone)
    assert (after.alert, after.fell) == (told, told)


@pytest.mark.parametrize("phase", [Phase.TAKING_OFF, Phase.LANDING])
@pytest.mark.parametrize(("height", "told"), [(0.24, None), (0.26, LIES)])
def test_a_drone_that_tips_over_on_the_floor_has_not_fallen(
    phase: Phase, height: float, told: str | None
) -> None:
    after, _ = look(state_in(phase), drone=TUMBLED, estimate_position=(-3.0, 0.0, height))
    assert after.fell == told


@pytest.mark.parametrize("phase", [Phase.MOVING_TO_START, Phase.APPROACHING, Phase.BRAKING])
def test_where_nothing_may_be_on_the_floor_it_has_fallen_there(phase: Phase) -> None:
    after, _ = look(state_in(phase), drone=TUMBLED, estimate_position=(-3.0, 0.0, 0.1))
    assert after.fell == LIES


@pytest.mark.parametrize(
    ("reported", "then"),
    [
        (LandingState.FLIP, Phase.FLIPPING),
        (LandingState.CUT, Phase.SETTLING),
        (LandingState.FAULT, Phase.BRAKING),
    ],
)
def test_what_the_landing_app_did_is_not_called_the_supervisors_doing(
    reported: LandingState, then: Phase
) -> None:
    """A flip, and the cut after it; a fault is told by its own name with the next look."""
    after, _ = look(state_in(Phase.APPROACHING), drone=TUMBLED, landing_state=reported, trigger_count=1)
    assert (after.phase, after.fell) == (then, None)


@pytest.mark.parametrize("phase", [Phase.ARMING, Phase.FLIPPING, Phase.SETTLING, Phase.DISARMING])
def test_motors_that_need_not_turn_are_not_told(phase: Phase) -> None:
    after, _ = look(state_in(phase), drone=FALLS)
    assert after.fell is None


def test_how_it_fell_is_told_once() -> None:
    state = replace(state_in(Phase.MOVING_TO_START), fell="earlier")
    assert look(state, drone=FALLS)[0].fell == "earlier"


@pytest.mark.parametrize("phase", [phase for phase in ALL_PHASES if phase not in BEFORE_ARMING])
def test_motors_that_are_cut_in_the_air_because_the_link_is_lost_are_told(phase: Phase) -> None:
    after, _ = step(state_in(phase), LinkDown("link_lost: silent"), PERIOD, mission_of(phase))
    flies = phase in (*HOVERING, Phase.APPROACHING, *DESCENDING)
    assert after.fell == (TOLD.format("the host did it (link_lost: silent)") if flies else None)


def test_what_was_told_before_stays_when_the_drone_is_down() -> None:
    state = replace(state_in(Phase.LANDING), answered_at=0.0, alert="STILL ARMED", fell="earlier")
    floor = (-3.0, 0.0, 0.1)
    after, ordered = look(state, Timing().land, pose_position=floor, estimate_position=floor)
    assert (after.phase, ordered) == (Phase.DISARMING, [Disarm])
    assert (after.alert, after.fell) == ("STILL ARMED", "earlier")
