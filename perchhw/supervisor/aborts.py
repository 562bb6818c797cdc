"""Leaving the plan: the safest way out of an attempt from each of its phases."""

from dataclasses import replace

from perchhw.supervisor.events import Brake, Disarm, EmergencyStop, Land
from perchhw.supervisor.observation import Observation
from perchhw.supervisor.rules import Rule, first_violation
from perchhw.supervisor.state import Context, FlightState, Phase, Step


def enter(state: FlightState, phase: Phase, context: Context, waiting_for: str = "") -> FlightState:
    """The state at the moment it enters `phase`, waiting for what `waiting_for` says."""
    return replace(state, phase=phase, entered_at=context.now, good_since=None, waiting_for=waiting_for)


def abort(state: FlightState, why: str, context: Context) -> Step:
    """End the attempt in the safest way that the present phase leaves open."""
    state = replace(state, aborted_by=state.aborted_by or why)
    match state.phase:
        case Phase.CHECKING | Phase.UPLOADING:
            return Step(enter(state, Phase.DONE, context))
        case Phase.ARMING:
            return disarm(state, context)
        case Phase.TAKING_OFF | Phase.MOVING_TO_START | Phase.ARMING_APPROACH | Phase.TEST_FLIGHT:
            return land(state, context)
        case Phase.APPROACHING:
            return Step(enter(state, Phase.BRAKING, context, "the drone to brake"), (Brake(),))
        case Phase.BRAKING | Phase.LANDING:
            # The gentle way failed; an unknown drone in the air is stopped.
            return Step(enter(state, Phase.DISARMING, context, "the motors to stop"), (EmergencyStop(),))
        case Phase.DISARMING:
            return Step(enter(state, Phase.DONE, context), (EmergencyStop(),))
        case _:
            return Step(state)


def link_down(state: FlightState, reason: str, context: Context) -> Step:
    """Nothing reaches the drone any more; its own watchdogs stop it."""
    done = replace(enter(state, Phase.DONE, context), link_lost=reason)
    if state.phase in (Phase.FLIPPING, Phase.SETTLING):
        return Step(done)
    return Step(replace(done, aborted_by=state.aborted_by or reason))


def operator_abort(state: FlightState, urgent: bool, context: Context) -> Step:
    """Land when asked once, cut the motors when asked twice. A flip is over before a hand could matter."""
    stopped = replace(state, aborted_by=state.aborted_by or "operator")
    if urgent:
        commands = (EmergencyStop(),) if state.armed or state.phase is Phase.ARMING else ()
        return Step(enter(stopped, Phase.DONE, context), commands)
    match state.phase:
        case Phase.SETTLING:
            return disarm(state, context)
        case Phase.FLIPPING | Phase.BRAKING | Phase.LANDING | Phase.DISARMING:
            return Step(stopped if state.phase is not Phase.FLIPPING else state)
        case _:
            return abort(state, "operator", context)


def land(state: FlightState, context: Context) -> Step:
    """Descend to the floor on the spot."""
    return Step(
        enter(state, Phase.LANDING, context, "the drone to reach the floor"), (Land(context.timing.land),)
    )


def disarm(state: FlightState, context: Context) -> Step:
    """Stop the motors and wait until the drone confirms it."""
    return Step(enter(state, Phase.DISARMING, context, "the motors to be disarmed"), (Disarm(),))


def elapsed(state: FlightState, context: Context) -> float:
    """Time in the present phase, s."""
    return context.now - state.entered_at


def guard(state: FlightState, rules: tuple[Rule, ...], o: Observation, context: Context) -> Step | None:
    """The abort that a broken safety rule demands, or ``None``."""
    violation = first_violation(rules, o, context.limits)
    return None if violation is None else abort(state, str(violation), context)
