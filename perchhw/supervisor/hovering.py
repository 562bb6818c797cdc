"""The phases from take-off to the start of the approach, and the test flight."""

from dataclasses import replace
from math import dist, hypot

from onboard.app_interface import LandingState
from onboard.arrays import Vector
from perchhw.supervisor.aborts import abort, elapsed, enter, guard, held, land, order
from perchhw.supervisor.events import ArmApproach, FlyCourse, GoTo, StartApproach
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.on_ground import policy_guard
from perchhw.supervisor.rules import HOVER_RULES, TAKE_OFF_RULES, TEST_FLIGHT_RULES
from perchhw.supervisor.state import Context, FlightState, Phase, Step

_RISE_ERROR = 0.1
"""m from the height of the first hover, from which the drone moves on."""
_HOVER_ERROR, _HOVER_SPEED = 0.08, 0.15
"""m and m/s at the start of the approach; the drone itself demands 0.25 m and 0.3 m/s there."""


def _settled_at(o: Admitted, place: Vector) -> bool:
    """The drone hovers at `place` (m)."""
    if o.estimate_position is None or o.estimate_velocity is None:
        return False
    return dist(o.estimate_position, place) < _HOVER_ERROR and hypot(*o.estimate_velocity) < _HOVER_SPEED


def taking_off(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the first hover is steady."""
    stop = guard(state, TAKE_OFF_RULES, o, context)
    if stop is not None:
        return stop
    timing, mission = context.timing, context.mission
    risen = (
        o.estimate_position is not None and abs(o.estimate_position[2] - mission.hover_height) < _RISE_ERROR
    )
    state, steady = held(
        state, risen and elapsed(state, context) >= timing.take_off, timing.hover_hold, context
    )
    if steady and o.estimate_position is not None:
        duration = max(2.0, dist(o.estimate_position, mission.start) / mission.transit_speed)
        moving = enter(state, Phase.MOVING_TO_START, context, "the start of the approach")
        return order(moving, GoTo(mission.start, duration))
    if elapsed(state, context) > timing.take_off + timing.move_margin:
        return abort(state, f"no steady hover at {mission.hover_height:g} m after take-off", context)
    return Step(state)


def moving_to_start(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the drone hovers where the approach or the course begins."""
    stop = guard(state, HOVER_RULES, o, context)
    if stop is not None:
        return stop
    timing, mission = context.timing, context.mission
    state, steady = held(state, _settled_at(o, mission.start), timing.hover_hold, context)
    if steady and mission.test_flight:
        return order(enter(state, Phase.TEST_FLIGHT, context, "the end of the course"), FlyCourse())
    if steady:
        arming = enter(state, Phase.ARMING_APPROACH, context, "the drone to accept the approach")
        return order(replace(arming, approach_ordered=True), ArmApproach())
    room = context.limits.room
    longest = (room.x_max - room.x_min) / mission.transit_speed + timing.move_margin
    if elapsed(state, context) > longest:
        return abort(state, f"the start of the approach was not reached within {longest:.1f} s", context)
    return Step(state)


def _not_ready(state: FlightState, o: Admitted) -> str | None:
    """What is still missing until the approach may start, or ``None``."""
    if state.answered_at is None:
        return "the order to arm it has not been answered"
    if o.landing_state is not LandingState.TRAJECTORY_ARMED:
        return f"its landing state is {'unknown' if o.landing_state is None else o.landing_state.name}"
    for name, switch in (("trajectory", o.trajectory_armed), ("policy", o.policy_armed)):
        if switch is not True:
            return f"the switch of the {name} was {'not read back' if switch is None else 'read back as off'}"
    return "its count of triggers is unknown" if o.trigger_count is None else None


def arming_approach(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until trajectory and policy are armed, and both switches were read back."""
    stop = guard(state, HOVER_RULES, o, context) or policy_guard(state, o, context)
    if stop is not None:
        return stop
    missing = _not_ready(state, o)
    if missing is None and o.trigger_count is not None:
        approaching = enter(state, Phase.APPROACHING, context, "the trigger")
        return order(replace(approaching, triggers_before=o.trigger_count), StartApproach())
    if elapsed(state, context) > context.timing.approach_arm_deadline:
        return abort(state, f"the drone did not arm the approach: {missing}", context)
    return Step(state)


def flying_course(state: FlightState, o: Admitted, context: Context) -> Step:
    """Until the course was flown."""
    stop = guard(state, TEST_FLIGHT_RULES, o, context)
    if stop is not None:
        return stop
    if elapsed(state, context) > context.mission.approach_duration + context.timing.course_margin:
        return abort(state, "the course did not come to its end", context)
    return Step(state)


def after_course(state: FlightState, context: Context) -> Step:
    """Land when the course was flown; one that was broken off is being landed already."""
    return land(state, context) if state.phase is Phase.TEST_FLIGHT else Step(state)
