"""The flight as a state machine: (state, event, clock) -> (state, orders), pure.

Check, upload, arm, take off, move to the start, approach, flip, settle, disarm; abort from anywhere. A test
flight has no policy to upload, follows its course instead of an approach, and lands on the floor.
"""

from dataclasses import replace
from math import isfinite

from perchhw.supervisor.aborts import abort, carry_on_or_abort, elapsed, fell, link_down, operator_abort
from perchhw.supervisor.ending import after_stop
from perchhw.supervisor.events import (
    CommandDone,
    CommandFailed,
    Event,
    FlyCourse,
    HostStoodStill,
    InternalError,
    LinkDown,
    OperatorAbort,
    Order,
    RecordLost,
    StopConfirmed,
    StopUnconfirmed,
    Tick,
    UploadPolicy,
)
from perchhw.supervisor.gate import admit
from perchhw.supervisor.hovering import after_course
from perchhw.supervisor.landed import cut_by_supervisor
from perchhw.supervisor.limits import SafetyLimits
from perchhw.supervisor.observation import Admitted, Observation
from perchhw.supervisor.on_ground import after_upload
from perchhw.supervisor.phases import PHASES
from perchhw.supervisor.state import IN_FLIGHT, Context, FlightState, Mission, Phase, Step, Timing

STOPPED_BY_OTHERS = "; stopped by others: perchhw stop, or the drone's own supervisor"
"""What follows the rule that noticed it."""

_SIGNS_OF_A_STOP = ("drone_can_fly: no", "drone_state: locked", "drone_broke_off: not_flying", "Arm failed: ")
"""What a drone that others stop may show before it says that it is locked."""

_TICK = 0.02
"""s that are counted for an event when the clock cannot say."""


def initial_state(now: float) -> FlightState:
    """The state of an attempt that has a link and a pose stream, and nothing else, at time `now` (s)."""
    return FlightState(phase=Phase.CHECKING, entered_at=now, waiting_for="the preflight checks")


def step(
    state: FlightState,
    event: Event,
    now: float,
    mission: Mission,
    limits: SafetyLimits | None = None,
    timing: Timing | None = None,
) -> Step:
    """The next state and the orders that follow from `event` at time `now` (s of any monotonic clock)."""
    limits, timing = limits or SafetyLimits(), timing or Timing()
    state, problem = _at(state, now)
    context = Context(state.time, mission, limits, timing)
    if problem is None:
        return _react(state, event, context)
    state, first = _react(state, InternalError(problem), context)
    if first and state.phase is Phase.STOPPING:
        # The event is older than this stop, and cannot confirm it.
        return Step(state, first)
    state, second = _react(state, event, context)
    return Step(state, (*first, *second))


def _at(state: FlightState, now: float) -> tuple[FlightState, str | None]:
    """The state at `now`, and what is wrong with the clock. Time goes on even where the clock does not."""
    time = now + state.clock_shift
    if time >= state.time and isfinite(time):
        return replace(state, time=time), None
    resumed = (state.time if isfinite(state.time) else state.entered_at) + _TICK
    if not isfinite(now):
        return replace(state, time=resumed), f"the clock reads {now}"
    shifted = replace(state, time=resumed, clock_shift=resumed - now)
    return shifted, f"the clock ran back by {state.time - time:.3g} s"


def _react(state: FlightState, event: Event, context: Context) -> Step:
    if state.phase is Phase.DONE:
        return Step(state)
    match event:
        case Tick(observation):
            return _look(state, observation, context)
        case CommandDone(order, value):
            return _done(state, order, value, context) if _in_force(state, order) else Step(state)
        case CommandFailed(order, reason):
            if not _in_force(state, order) or state.phase is Phase.STOPPING:
                return Step(state)
            return abort(state, f"{type(order.command).__name__} failed: {reason}", context)
        case StopConfirmed():
            return after_stop(state, None, context)
        case StopUnconfirmed(reason):
            return after_stop(state, reason, context)
        case LinkDown(reason):
            return link_down(state, reason, context)
        case RecordLost(reason):
            latched = replace(state, record_lost=state.record_lost or reason)
            return carry_on_or_abort(latched, f"record_lost: {reason}", context)
        case HostStoodStill(reason):
            return carry_on_or_abort(state, f"host_stood_still: {reason}", context)
        case InternalError(reason):
            return _internal_error(state, f"internal_error: {reason}", context)
        case OperatorAbort(urgent):
            return operator_abort(state, urgent, context)


def _look(state: FlightState, observation: Observation, context: Context) -> Step:
    """Pass the observation through the gate and show the phase what is left of it."""
    admitted, memory = admit(observation, state.gate, context.limits, context.now)
    locked = state.locked or _stopped_by_others(state, admitted, context)
    state = replace(state, gate=memory, locked=locked)
    if state.phase in IN_FLIGHT and state.fell is None:
        state = fell(state, cut_by_supervisor(state, admitted, context.limits))
    step = PHASES[state.phase](state, admitted, context)
    return Step(_named_by_lock(step.state), step.orders)


def _stopped_by_others(state: FlightState, o: Admitted, context: Context) -> bool:
    """The drone's own supervisor has cut the motors, and neither for us nor because it lies upside down.

    A drone that is stopped lets no motor turn for 40 ms before it says that it is locked. While it is being
    disarmed nobody kicks its watchdog, which then locks it as well, but later.
    """
    drone = o.drone
    if drone is None or not state.arm_ordered or state.phase is Phase.STOPPING:
        return False
    if state.phase is Phase.DISARMING:
        return drone.is_locked and elapsed(state, context) <= context.timing.watchdog_margin
    falls = state.phase in IN_FLIGHT and not (drone.can_fly or drone.is_tumbled or drone.is_crashed)
    return drone.is_locked or falls


def _named_by_lock(state: FlightState) -> FlightState:
    """A stop of others shows first as a drone that cannot fly or does not arm: the stop is the reason."""
    sign = state.aborted_by or ""
    if not state.locked or not sign.startswith(_SIGNS_OF_A_STOP) or sign.endswith(STOPPED_BY_OTHERS):
        return state
    return replace(state, aborted_by=sign + STOPPED_BY_OTHERS)


def _in_force(state: FlightState, order: Order) -> bool:
    return state.oldest_in_force <= order.number <= state.orders_given


def _done(state: FlightState, order: Order, value: int | None, context: Context) -> Step:
    state = replace(state, answered_at=context.now)
    match order.command:
        case UploadPolicy():
            return after_upload(state, value, context)
        case FlyCourse():
            return after_course(state, context)
        case _:
            return Step(state)


def _internal_error(state: FlightState, why: str, context: Context) -> Step:
    """End the attempt in the safest way. What carries on saw nothing this time: its deadlines still count."""
    phase = state.phase
    step = carry_on_or_abort(replace(state, aborted_by=state.aborted_by or why), why, context)
    return step if step.state.phase is not phase else _look(step.state, Observation(), context)
