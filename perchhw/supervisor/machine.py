"""The flight as a state machine: (state, event, clock) -> (state, commands), pure.

Check, upload, arm, take off, move to the start, approach, flip, settle, disarm; abort from anywhere. A test
flight has no policy to upload, follows its course instead of an approach, and lands on the floor.
"""

from perchhw.supervisor.aborts import abort, link_down, operator_abort
from perchhw.supervisor.events import (
    CommandDone,
    CommandFailed,
    Event,
    FlyCourse,
    LinkDown,
    OperatorAbort,
    Tick,
    UploadPolicy,
)
from perchhw.supervisor.phases import PHASES, after_course, after_upload
from perchhw.supervisor.rules import SafetyLimits
from perchhw.supervisor.state import Context, FlightState, Mission, Phase, Step, Timing


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
    """The next state and the commands that follow from `event` at time `now` (s of any monotonic clock)."""
    context = Context(now, mission, limits or SafetyLimits(), timing or Timing())
    if state.phase is Phase.DONE:
        return Step(state)
    match event:
        case Tick(observation):
            return PHASES[state.phase](state, observation, context)
        case CommandDone(UploadPolicy(), value):
            return after_upload(state, value, context)
        case CommandDone(FlyCourse()):
            return after_course(state, context)
        case CommandDone():
            return Step(state)
        case CommandFailed(command, reason):
            return abort(state, f"{type(command).__name__} failed: {reason}", context)
        case LinkDown(reason):
            return link_down(state, reason, context)
        case OperatorAbort(urgent):
            return operator_abort(state, urgent, context)
