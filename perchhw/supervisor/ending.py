"""The phases in which an attempt ends: braking, landing, disarming, stopping."""

from dataclasses import replace

from onboard.app_interface import LandingState
from perchhw.supervisor.aborts import (
    abort,
    disarm,
    elapsed,
    ended_early,
    enter,
    fell,
    held,
    land,
    lasting,
    stop,
    tell,
)
from perchhw.supervisor.descent import COURSE_DESCENT_RULES, DESCENT_RULES
from perchhw.supervisor.landed import cut_by_itself, is_down
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.state import Context, FlightState, Phase, Step
from perchhw.supervisor.violation import first_violation

_MOTORS_CUT = (LandingState.CUT, LandingState.FAULT)


def _descent_guard(state: FlightState, o: Admitted, context: Context) -> tuple[FlightState, Step | None]:
    """The stop that a rule of the descent demands once it has been broken for long, or ``None``."""
    rules = COURSE_DESCENT_RULES if context.mission.test_flight else DESCENT_RULES
    violation = first_violation(rules, o, context.limits)
    state, lost = lasting(state, violation is not None, context.timing.stop_hold, context)
    if not lost or violation is None:
        return state, None
    return state, abort(state, str(violation), context)


def braking(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the drone holds, has cut its motors, or has had its time; or nobody knows what it does."""
    if o.landing_state in _MOTORS_CUT or (o.drone is not None and not o.drone.can_fly):
        return Step(enter(fell(state, cut_by_itself(o)), Phase.SETTLING, context, "the body to rest"))
    state, stopped = _descent_guard(state, o, context)
    if stopped is not None:
        return stopped
    # The hand-over asks the drone for its state, and waits until it has let go: it does not hang on this one.
    state, unknown = held(state, o.landing_state is None, context.timing.stop_hold, context)
    braked = o.landing_state in (LandingState.HOLD, LandingState.IDLE)
    if braked or unknown or elapsed(state, context) > context.timing.brake_deadline:
        return land(state, context)
    armed = _still_armed(state, o.policy_armed is False, "the policy was", context)
    return _tell_at_once(state, armed, context)


def landing(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the drone is on the floor."""
    since = elapsed(state, context)
    off = o.landing_state in _MOTORS_CUT or (o.drone is not None and not o.drone.can_fly)
    state = fell(state, cut_by_itself(o))
    # From the answer on, not from the order: a drone that takes over late is still on its way down.
    descended = state.answered_at is not None and context.now - state.answered_at >= context.timing.land
    if off or (is_down(o, context.limits) and descended):
        return disarm(state, context)
    state, stopped = _descent_guard(state, o, context)
    if stopped is not None:
        return stopped
    if since > context.timing.land + context.timing.land_margin:
        return abort(state, "the drone did not reach the floor", context)
    off = o.policy_armed is False and o.trajectory_armed is False
    armed = _still_armed(state, off, "approach and policy were", context)
    return _tell_at_once(state, armed, context)


def _still_armed(state: FlightState, off: bool, what: str, context: Context) -> str | None:
    """What to tell when the landing app's switches do not read back as `off` in a descent, or ``None``."""
    if off or not state.approach_ordered or elapsed(state, context) <= context.timing.switches_deadline:
        return None
    return f"STILL ARMED: {what} not read back as off; keep away from the drone"


def _tell_at_once(state: FlightState, alert: str | None, context: Context) -> Step:
    """What is told is told at once; that it is over, when it has been for a while."""
    return Step(tell(state, alert, context.timing.hang_hold if alert is None else 0.0, context))


def disarming(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the drone says that it is not armed, in bits that are newer than the answer to the order."""
    answered = state.answered_at
    renewed = (
        answered is not None
        and o.drone_age is not None
        and context.now - o.drone_age >= answered + context.timing.bits_delay
    )
    off = o.drone is not None and not o.drone.is_armed
    state, disarmed = held(state, renewed and off, context.timing.disarm_hold, context)
    if disarmed:
        return Step(enter(state, Phase.DONE, context))
    if elapsed(state, context) > context.timing.disarm_deadline:
        return stop(ended_early(state, "disarming: the drone did not confirm it"), context)
    return Step(state)


def stopping(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the stop path says what came of it. One that never says so may have stopped nothing."""
    if elapsed(state, context) <= context.timing.stop_deadline:
        return Step(state)
    return after_stop(
        state, f"the stop path did not report within {context.timing.stop_deadline:g} s", context
    )


def after_stop(state: FlightState, unconfirmed: str | None, context: Context) -> Step:
    """The stop path has ended: with locked motors, or `unconfirmed` for a reason."""
    if state.phase is not Phase.STOPPING:
        return Step(state)
    if unconfirmed is not None:
        told = f"STOP NOT CONFIRMED ({unconfirmed}): the motors may turn; keep away from the drone"
        state = ended_early(state, f"stop_unconfirmed: {unconfirmed}")
        state = replace(state, stop_unconfirmed=unconfirmed, alert=told)
    return Step(enter(state, Phase.DONE, context))
