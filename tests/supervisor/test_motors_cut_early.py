"""Motors that are cut before the drone is down, by the drone or by the host: told at once, and remembered."""

from dataclasses import replace
from typing import Any

import pytest

from onboard.app_interface import EndReason, LandingState
from perchhw.supervisor import CommandFailed, FlightState, Order, Phase, Tick, Timing, step
from perchhw.supervisor.events import Brake, Disarm, EmergencyStop, Land

from .simulated_attempt import MISSION, PERIOD
from .states import DESCENDING, good_in, state_in

TOLD = "MOTORS CUT BEFORE IT WAS DOWN: {}; a drone in the air has fallen"
FAULT = TOLD.format("the drone did it by itself, its estimate cannot be true any more (FAULT)")
CUT = TOLD.format("the drone did it by itself, it met the ceiling, or was tilted by more than 70 deg (CUT)")
ENDED = TOLD.format("the drone did it by itself, its supervisor ended the flight (CUT)")


def look(state: FlightState, now: float = PERIOD, **changes: Any) -> tuple[FlightState, list[type]]:
    """The state after one look, well but for `changes`, and what was ordered."""
    after, orders = step(state, Tick(replace(good_in(state.phase), **changes)), now, MISSION)
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


def test_what_was_told_before_stays_when_the_drone_is_down() -> None:
    state = replace(state_in(Phase.LANDING), answered_at=0.0, alert="STILL ARMED", fell="earlier")
    floor = (-3.0, 0.0, 0.1)
    after, ordered = look(state, Timing().land, pose_position=floor, estimate_position=floor)
    assert (after.phase, ordered) == (Phase.DISARMING, [Disarm])
    assert (after.alert, after.fell) == ("STILL ARMED", "earlier")
