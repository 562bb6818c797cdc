"""Leaving the plan: the safest way out of an attempt from each of its phases."""

from dataclasses import replace

from perchhw.supervisor.events import Arm, Brake, Command, Disarm, EmergencyStop, Land, Order
from perchhw.supervisor.landed import STOPPED_ELSEWHERE, fell_because
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.state import IN_FLIGHT, Context, FlightState, Phase, Step
from perchhw.supervisor.violation import Rule, Violation, at_most, first_violation


def enter(state: FlightState, phase: Phase, context: Context, waiting_for: str = "") -> FlightState:
    """The state at the moment it enters `phase`, waiting for what `waiting_for` says.

    Whatever was ordered in an earlier phase is no longer in force.
    """
    return replace(
        state,
        phase=phase,
        entered_at=context.now,
        good_since=None,
        bad_since=None,
        answered_at=None,
        oldest_in_force=state.orders_given + 1,
        waiting_for=waiting_for,
    )


def order(state: FlightState, command: Command) -> Step:
    """Give `command` as the next order."""
    number = state.orders_given + 1
    arm_ordered = state.arm_ordered or isinstance(command, Arm)
    return Step(replace(state, orders_given=number, arm_ordered=arm_ordered), (Order(number, command),))


def ended_early(state: FlightState, why: str) -> FlightState:
    """The state that remembers the first reason why the attempt did not go on as planned.

    Once a drone that triggered is being disarmed, its landing is over, and nothing makes an abort of it.
    """
    if state.triggered and state.phase in (Phase.DISARMING, Phase.STOPPING):
        return state
    return replace(state, aborted_by=state.aborted_by or why)


def abort(state: FlightState, why: str, context: Context) -> Step:
    """End the attempt in the safest way that the present phase leaves open."""
    state = ended_early(state, why)
    match state.phase:
        case Phase.CHECKING | Phase.UPLOADING | Phase.READY:
            return Step(enter(state, Phase.DONE, context))
        case Phase.ARMING:
            return disarm(state, context)
        case Phase.TAKING_OFF | Phase.MOVING_TO_START | Phase.ARMING_APPROACH | Phase.TEST_FLIGHT:
            return land(state, context)
        case Phase.APPROACHING:
            return order(enter(state, Phase.BRAKING, context, "the drone to brake"), Brake())
        case Phase.BRAKING | Phase.LANDING:
            # The gentle way failed; an unknown drone in the air is stopped.
            who = STOPPED_ELSEWHERE if state.locked else f"the host did it ({why})"
            return stop(fell(state, fell_because(who)), context)
        case Phase.DISARMING:
            return stop(state, context)
        case _:
            return Step(state)


def carry_on_or_abort(state: FlightState, why: str, context: Context) -> Step:
    """After a failure of the program: end the attempt, unless what runs already ends it by itself."""
    match state.phase:
        case (
            Phase.FLIPPING | Phase.SETTLING | Phase.BRAKING | Phase.LANDING | Phase.DISARMING | Phase.STOPPING
        ):
            return Step(state)
        case _:
            return abort(state, why, context)


def fell(state: FlightState, how: str | None) -> FlightState:
    """The state that tells, and remembers, how motors came to be cut early; ``None``: they were not."""
    return state if how is None else replace(state, fell=how, alert=how)


def stop(state: FlightState, context: Context) -> Step:
    """Cut the motors, and wait until the stop path has said what came of it."""
    return order(enter(state, Phase.STOPPING, context, "the drone to report locked motors"), EmergencyStop())


def link_down(state: FlightState, reason: str, context: Context) -> Step:
    """The link is gone. A landing is over by itself; motors that may turn elsewhere are stopped.

    The drone's own watchdog stops them as well, but a stop takes another path than the link that broke.
    """
    state = replace(state, link_lost=state.link_lost or reason)
    match state.phase:
        case Phase.STOPPING:
            return Step(state)
        case Phase.FLIPPING | Phase.SETTLING:
            return Step(enter(state, Phase.DONE, context))
    state = ended_early(state, reason)
    if state.phase in IN_FLIGHT:
        state = fell(state, fell_because(f"the host did it ({reason})"))
    return stop(state, context) if state.arm_ordered else Step(enter(state, Phase.DONE, context))


def operator_abort(state: FlightState, urgent: bool, context: Context) -> Step:
    """Land when asked once, cut the motors when asked twice. A flip is over before a hand could matter,
    and what comes of it is worth its record."""
    if state.phase is Phase.STOPPING:
        return Step(state)
    stopped = ended_early(state, "operator")
    if urgent:
        return stop(stopped, context) if state.arm_ordered else Step(enter(stopped, Phase.DONE, context))
    match state.phase:
        case Phase.FLIPPING | Phase.SETTLING:
            return Step(state)
        case Phase.BRAKING | Phase.LANDING | Phase.DISARMING:
            return Step(stopped)
        case _:
            return abort(state, "operator", context)


def land(state: FlightState, context: Context) -> Step:
    """Descend to the floor on the spot."""
    return order(
        enter(state, Phase.LANDING, context, "the drone to reach the floor"), Land(context.timing.land)
    )


def disarm(state: FlightState, context: Context) -> Step:
    """Stop the motors and wait until the drone confirms it."""
    return order(enter(state, Phase.DISARMING, context, "the motors to be disarmed"), Disarm())


def elapsed(state: FlightState, context: Context) -> float:
    """Time in the present phase, s."""
    return context.now - state.entered_at


def held(state: FlightState, good: bool, hold: float, context: Context) -> tuple[FlightState, bool]:
    """Whether a condition has held for `hold` s without a break, and the state that remembers since when."""
    if not good:
        return replace(state, good_since=None), False
    since = context.now if state.good_since is None else state.good_since
    return replace(state, good_since=since), context.now - since >= hold


def lasting(state: FlightState, bad: bool, hold: float, context: Context) -> tuple[FlightState, bool]:
    """Whether something bad has gone on for `hold` s without a break, and the state that remembers it."""
    if not bad:
        return replace(state, bad_since=None), False
    since = context.now if state.bad_since is None else state.bad_since
    return replace(state, bad_since=since), context.now - since >= hold


def tell(state: FlightState, alert: str | None, hold: float, context: Context) -> FlightState:
    """The state that tells `alert`, once something else than what is told was due for `hold` s.

    What stands before the colon says what is told; figures behind it that change are not told again.
    """
    if _heading(alert) == _heading(state.alert):
        return replace(state, alert_due_since=None)
    since = context.now if state.alert_due_since is None else state.alert_due_since
    if context.now - since < hold:
        return replace(state, alert_due_since=since)
    return replace(state, alert=alert, alert_due_since=None)


def _heading(alert: str | None) -> str:
    return (alert or "").partition(":")[0]


def guard(state: FlightState, rules: tuple[Rule, ...], o: Admitted, context: Context) -> Step | None:
    """The abort that a broken safety rule demands, or ``None``."""
    violation = first_violation(rules, o, context.limits) or _overtime(state, context)
    return None if violation is None else abort(state, str(violation), context)


def _overtime(state: FlightState, context: Context) -> Violation | None:
    """The flight as a whole takes no longer than it may."""
    if state.airborne_since is None:
        return None
    longest = context.limits.flight_time + context.mission.approach_duration
    return at_most("flight_time", context.now - state.airborne_since, longest, "s")
