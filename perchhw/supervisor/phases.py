"""The phases of an attempt, one function each: what it watches, when it moves on, and its deadline.

An unknown or late answer is an abort, never a wait without end.
"""

from collections.abc import Callable
from dataclasses import replace
from math import dist, hypot

from onboard.app_interface import EndReason, LandingState
from onboard.arrays import Vector
from perchhw.supervisor.aborts import abort, disarm, elapsed, enter, guard, land, order, stop
from perchhw.supervisor.events import (
    Arm,
    ArmApproach,
    FlyCourse,
    GoTo,
    StartApproach,
    TakeOff,
    UploadPolicy,
)
from perchhw.supervisor.observation import Admitted
from perchhw.supervisor.rules import (
    APPROACH_RULES,
    GROUND_RULES,
    HOVER_RULES,
    PREFLIGHT_RULES,
    TEST_FLIGHT_RULES,
    first_violation,
    pose_good,
)
from perchhw.supervisor.state import Context, FlightState, Phase, Step

_RISE_ERROR = 0.1
"""m from the height of the first hover, from which the drone moves on."""
_HOVER_ERROR, _HOVER_SPEED = 0.08, 0.15
"""m and m/s at the start of the approach; the drone itself demands 0.25 m and 0.3 m/s there."""


def _held(state: FlightState, good: bool, hold: float, context: Context) -> tuple[FlightState, bool]:
    """Whether a condition has held for `hold` s without a break, and the state that remembers since when."""
    if not good:
        return replace(state, good_since=None), False
    since = context.now if state.good_since is None else state.good_since
    return replace(state, good_since=since), context.now - since >= hold


# --- on the ground ----------------------------------------------------------------------------------------


def _checking(state: FlightState, o: Admitted, context: Context) -> Step:
    violation = first_violation(PREFLIGHT_RULES, o, context.limits)
    if violation is not None and elapsed(state, context) > context.timing.checks_deadline:
        return abort(state, str(violation), context)
    waiting = "the preflight checks" if violation is None else str(violation)
    state, passed = _held(
        replace(state, waiting_for=waiting), violation is None, context.timing.checks_hold, context
    )
    if not passed:
        return Step(state)
    if context.mission.test_flight:
        return _ready(state, context)
    return order(enter(state, Phase.UPLOADING, context, "the policy upload"), UploadPolicy())


def _ready(state: FlightState, context: Context) -> Step:
    """All checks passed: arm, unless this is a rehearsal."""
    if context.mission.dry_run:
        return Step(enter(state, Phase.DONE, context))
    return order(enter(state, Phase.ARMING, context, "the drone to arm"), Arm())


def _uploading(state: FlightState, o: Admitted, context: Context) -> Step:
    if elapsed(state, context) > context.timing.upload_deadline:
        return abort(state, f"policy upload took longer than {context.timing.upload_deadline:g} s", context)
    return guard(state, GROUND_RULES, o, context) or Step(state)


def after_upload(state: FlightState, crc: int | None, context: Context) -> Step:
    """Arm when the drone's live policy has the CRC (`crc`, unknown: ``None``) of the one to be flown."""
    if state.phase is not Phase.UPLOADING:
        return Step(state)
    if crc != context.mission.policy_crc:
        live = "unknown" if crc is None else f"{crc:08x}"
        return abort(
            state, f"policy_crc: the drone has {live}, need {context.mission.policy_crc:08x}", context
        )
    return _ready(state, context)


def _arming(state: FlightState, o: Admitted, context: Context) -> Step:
    stop = guard(state, GROUND_RULES, o, context)
    if stop is not None:
        return stop
    armed = o.drone is not None and o.drone.is_armed and o.drone.can_fly
    state, ready = _held(state, armed, context.timing.arm_hold, context)
    if ready:
        # Only now: telemetry from before the upload may still be in flight earlier in this phase.
        stop = _policy_guard(state, o, context)
        if stop is not None:
            return stop
        flying = replace(enter(state, Phase.TAKING_OFF, context, "the first hover"), armed=True)
        return order(flying, TakeOff(context.mission.hover_height, context.timing.take_off))
    if elapsed(state, context) > context.timing.arm_deadline:
        return abort(
            state, f"the drone did not arm within {context.timing.arm_deadline:g} s ({o.drone})", context
        )
    return Step(state)


def _policy_guard(state: FlightState, o: Admitted, context: Context) -> Step | None:
    """The live policy is the one that was uploaded, or the attempt ends. A test flight needs none."""
    if context.mission.test_flight or o.active_policy_crc == context.mission.policy_crc:
        return None
    live = "unknown" if o.active_policy_crc is None else f"{o.active_policy_crc:08x}"
    return abort(state, f"policy_crc: the drone has {live}, need {context.mission.policy_crc:08x}", context)


# --- hovering ---------------------------------------------------------------------------------------------


def _settled_at(o: Admitted, place: Vector) -> bool:
    """The drone hovers at `place` (m)."""
    if o.estimate_position is None or o.estimate_velocity is None:
        return False
    return dist(o.estimate_position, place) < _HOVER_ERROR and hypot(*o.estimate_velocity) < _HOVER_SPEED


def _taking_off(state: FlightState, o: Admitted, context: Context) -> Step:
    stop = guard(state, HOVER_RULES, o, context)
    if stop is not None:
        return stop
    timing, mission = context.timing, context.mission
    risen = (
        o.estimate_position is not None and abs(o.estimate_position[2] - mission.hover_height) < _RISE_ERROR
    )
    state, steady = _held(
        state, risen and elapsed(state, context) >= timing.take_off, timing.hover_hold, context
    )
    if steady and o.estimate_position is not None:
        duration = max(2.0, dist(o.estimate_position, mission.start) / mission.transit_speed)
        moving = enter(state, Phase.MOVING_TO_START, context, "the start of the approach")
        return order(moving, GoTo(mission.start, duration))
    if elapsed(state, context) > timing.take_off + timing.move_margin:
        return abort(state, f"no steady hover at {mission.hover_height:g} m after take-off", context)
    return Step(state)


def _moving_to_start(state: FlightState, o: Admitted, context: Context) -> Step:
    stop = guard(state, HOVER_RULES, o, context)
    if stop is not None:
        return stop
    timing, mission = context.timing, context.mission
    state, steady = _held(state, _settled_at(o, mission.start), timing.hover_hold, context)
    if steady and mission.test_flight:
        return order(enter(state, Phase.TEST_FLIGHT, context, "the end of the course"), FlyCourse())
    if steady:
        arming = enter(state, Phase.ARMING_APPROACH, context, "the drone to accept the approach")
        return order(arming, ArmApproach())
    room = context.limits.room
    longest = (room.x_max - room.x_min) / mission.transit_speed + timing.move_margin
    if elapsed(state, context) > longest:
        return abort(state, f"the start of the approach was not reached within {longest:.1f} s", context)
    return Step(state)


def _arming_approach(state: FlightState, o: Admitted, context: Context) -> Step:
    stop = guard(state, HOVER_RULES, o, context) or _policy_guard(state, o, context)
    if stop is not None:
        return stop
    if _landing_state(o, context) is LandingState.TRAJECTORY_ARMED and o.trigger_count is not None:
        approaching = enter(state, Phase.APPROACHING, context, "the trigger")
        return order(replace(approaching, triggers_before=o.trigger_count), StartApproach())
    if elapsed(state, context) > context.timing.approach_arm_deadline:
        reported = "unknown" if o.landing_state is None else o.landing_state.name
        return abort(state, f"the drone did not arm the approach: its landing state is {reported}", context)
    return Step(state)


def _test_flight(state: FlightState, o: Admitted, context: Context) -> Step:
    stop = guard(state, TEST_FLIGHT_RULES, o, context)
    if stop is not None:
        return stop
    if elapsed(state, context) > context.mission.approach_duration + context.timing.course_margin:
        return abort(state, "the course did not come to its end", context)
    return Step(state)


def after_course(state: FlightState, context: Context) -> Step:
    """Land when the course was flown; one that was broken off is being landed already."""
    return land(state, context) if state.phase is Phase.TEST_FLIGHT else Step(state)


# --- the approach and after -------------------------------------------------------------------------------


def _landing_state(o: Admitted, context: Context) -> LandingState | None:
    """The landing state of the drone as it is now, or ``None`` when that is not known."""
    fresh = o.landing_age is not None and o.landing_age <= context.limits.telemetry_age
    return o.landing_state if fresh else None


def _broken_off_by(o: Admitted, context: Context) -> str | None:
    """Why the drone broke off its approach; ``None`` for a trigger that did not come, which is no abort."""
    if o.end_reason is EndReason.MISSED_TRIGGER:
        return None
    reason = "unknown" if o.end_reason is None else o.end_reason.name.lower()
    pose = pose_good(o, context.limits)
    return f"drone_broke_off: {reason}" + ("" if pose is None else f" ({pose})")


def _approaching(state: FlightState, o: Admitted, context: Context) -> Step:
    match _landing_state(o, context):
        case LandingState.FLIP:
            return Step(replace(enter(state, Phase.FLIPPING, context, "the end of the flip"), triggered=True))
        case LandingState.CUT:
            # The drone also cuts its motors on contact and on tilt; only its count tells a trigger.
            fired = o.trigger_count is not None and o.trigger_count > state.triggers_before
            return Step(replace(enter(state, Phase.SETTLING, context, "the body to rest"), triggered=fired))
        case LandingState.BRAKE | LandingState.HOLD:
            braking = enter(state, Phase.BRAKING, context, "the drone to brake")
            return Step(replace(braking, aborted_by=_broken_off_by(o, context)))
        case LandingState.FAULT:
            return abort(state, "the drone reports a fault in its landing state machine", context)
    stop = guard(state, APPROACH_RULES, o, context)
    if stop is not None:
        return stop
    if elapsed(state, context) > context.mission.approach_duration + context.timing.approach_margin:
        return abort(state, "the approach ended neither in a trigger nor in a brake", context)
    return Step(state)


def _flipping(state: FlightState, o: Admitted, context: Context) -> Step:
    if _landing_state(o, context) is LandingState.CUT:
        return Step(enter(state, Phase.SETTLING, context, "the body to rest"))
    if elapsed(state, context) > context.timing.flip_deadline:
        return stop(state, context)
    return Step(state)


def _settling(state: FlightState, o: Admitted, context: Context) -> Step:
    if elapsed(state, context) >= context.timing.settle:
        return disarm(state, context)
    return Step(state)


def _braking(state: FlightState, o: Admitted, context: Context) -> Step:
    landing_state = _landing_state(o, context)
    motors_stopped = landing_state in (LandingState.CUT, LandingState.FAULT)
    if motors_stopped or (o.drone is not None and not o.drone.can_fly):
        return Step(enter(state, Phase.SETTLING, context, "the body to rest"))
    braked = landing_state in (LandingState.HOLD, LandingState.IDLE)
    if braked or elapsed(state, context) > context.timing.brake_deadline:
        return land(state, context)
    return Step(state)


def _landing(state: FlightState, o: Admitted, context: Context) -> Step:
    since = elapsed(state, context)
    down = o.estimate_position is not None and o.estimate_position[2] < context.limits.height_on_ground
    stopped = o.drone is not None and not o.drone.can_fly
    if stopped or (down and since >= context.timing.land):
        return disarm(state, context)
    if since > context.timing.land + context.timing.land_margin:
        return abort(state, "the drone did not reach the floor", context)
    return Step(state)


def _disarming(state: FlightState, o: Admitted, context: Context) -> Step:
    if o.drone is not None and not (o.drone.is_armed and o.drone.can_fly):
        return Step(enter(state, Phase.DONE, context))
    if elapsed(state, context) > context.timing.disarm_deadline:
        return stop(state, context)
    return Step(state)


def after_stop(state: FlightState, unconfirmed: str | None, context: Context) -> Step:
    """The stop path has ended: with locked motors, or `unconfirmed` for a reason."""
    if state.phase is not Phase.STOPPING:
        return Step(state)
    if unconfirmed is not None:
        told = f"STOP NOT CONFIRMED ({unconfirmed}): the motors may turn; keep away from the drone"
        state = replace(state, alert=told, aborted_by=state.aborted_by or f"stop_unconfirmed: {unconfirmed}")
    return Step(enter(state, Phase.DONE, context))


def _stopping(state: FlightState, o: Admitted, context: Context) -> Step:
    """Only the stop path says when this is over."""
    return Step(state)


PHASES: dict[Phase, Callable[[FlightState, Admitted, Context], Step]] = {
    Phase.CHECKING: _checking,
    Phase.UPLOADING: _uploading,
    Phase.ARMING: _arming,
    Phase.TAKING_OFF: _taking_off,
    Phase.MOVING_TO_START: _moving_to_start,
    Phase.ARMING_APPROACH: _arming_approach,
    Phase.APPROACHING: _approaching,
    Phase.TEST_FLIGHT: _test_flight,
    Phase.FLIPPING: _flipping,
    Phase.SETTLING: _settling,
    Phase.BRAKING: _braking,
    Phase.LANDING: _landing,
    Phase.DISARMING: _disarming,
    Phase.STOPPING: _stopping,
}
