"""The phases from the start of the approach until the body rests."""

from dataclasses import replace

from onboard.app_interface import EndReason, LandingState
from perchhw.supervisor.aborts import abort, disarm, elapsed, enter, fell, guard, order, stop, tell
from perchhw.supervisor.corridor import inside_corridor
from perchhw.supervisor.events import DisarmPolicy
from perchhw.supervisor.landed import cut_by_itself, does_not_hold, inside_flip
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.rules import APPROACH_RULES, pose_good
from perchhw.supervisor.state import Context, FlightState, Phase, Step

_FLOWN_TO_THE_END = (EndReason.TRIGGERED, EndReason.TILT)
"""Why the drone cuts its motors by itself; any other reason is somebody else's: a stop, a disarming."""


def _broken_off_by(o: Admitted, context: Context) -> str | None:
    """Why the drone broke off its approach; ``None`` for a trigger that did not come, which is no abort."""
    if o.end_reason is EndReason.MISSED_TRIGGER:
        return None
    reason = "unknown" if o.end_reason is None else o.end_reason.name.lower()
    pose = pose_good(o, context.limits)
    return f"drone_broke_off: {reason}" + ("" if pose is None else f" ({pose})")


def approaching(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the trigger, or until the drone brakes."""
    match o.landing_state:
        case LandingState.FLIP:
            return Step(replace(enter(state, Phase.FLIPPING, context, "the end of the flip"), triggered=True))
        case LandingState.CUT:
            # The drone also cuts its motors on tilt; only its count tells a trigger.
            fired = o.trigger_count is not None and o.trigger_count > state.triggers_before
            settling = replace(enter(state, Phase.SETTLING, context, "the body to rest"), triggered=fired)
            if not fired and o.end_reason not in _FLOWN_TO_THE_END:
                settling = replace(settling, aborted_by=_broken_off_by(o, context))
            return Step(settling if fired else fell(settling, cut_by_itself(o)))
        case LandingState.BRAKE | LandingState.HOLD:
            braking = enter(state, Phase.BRAKING, context, "the drone to brake")
            return order(replace(braking, aborted_by=_broken_off_by(o, context)), DisarmPolicy())
        case LandingState.FAULT:
            return abort(state, "the drone reports a fault in its landing state machine", context)
        case LandingState.APPROACH if state.approach_began is None:
            state = replace(state, approach_began=context.now)
    if o.pose_position is not None:
        state = replace(state, flip_height=o.pose_position[2])
    broken = guard(state, APPROACH_RULES, o, context) or _corridor_guard(state, o, context)
    if broken is not None:
        return broken
    if elapsed(state, context) > context.mission.approach_duration + context.timing.approach_margin:
        return abort(state, "the approach ended neither in a trigger nor in a brake", context)
    return Step(state)


def _corridor_guard(state: FlightState, o: Admitted, context: Context) -> Step | None:
    """The drone is on its planned path: at its start until it is seen to have set out."""
    corridor = context.mission.corridor
    if corridor is None:
        return abort(state, "corridor: the planned approach is unknown, need one", context)
    flown = 0.0 if state.approach_began is None else context.now - state.approach_began
    violation = inside_corridor(o, corridor, flown, context.limits)
    return None if violation is None else abort(state, str(violation), context)


def flipping(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the drone has cut its motors. What takes longer, or falls, is no flip any more."""
    if o.landing_state is LandingState.CUT:
        return Step(enter(state, Phase.SETTLING, context, "the body to rest"))
    violation = inside_flip(o, state.flip_height, context.limits)
    if violation is not None:
        return stop(replace(state, aborted_by=state.aborted_by or str(violation)), context)
    if elapsed(state, context) <= context.timing.flip_deadline:
        return Step(state)
    if o.landing_state is None:
        # Nobody knows what it does; a flip is over by now, so a stop cannot cost the landing.
        return stop(replace(state, link_lost=state.link_lost or "no landing state during the flip"), context)
    late = f"flip_time: {o.landing_state.name} after {context.timing.flip_deadline:g} s, need CUT"
    return stop(replace(state, aborted_by=state.aborted_by or late), context)


def settling(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the body rests. Whether it holds is told at once; from here nothing can be done about it."""
    if state.triggered:
        state = tell(state, does_not_hold(o, context.limits), context.timing.hang_hold, context)
    if elapsed(state, context) >= context.timing.settle:
        return disarm(state, context)
    return Step(state)
