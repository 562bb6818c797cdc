"""The flight supervisor: a pure state machine and the safety rules that it obeys.

(state, event, clock) -> (state, orders). No I/O, no threads, no clock of its own: :mod:`perchhw.flight`
feeds it events and carries out its commands.
"""

from perchhw.supervisor.events import (
    CommandDone,
    CommandFailed,
    Event,
    InternalError,
    LinkDown,
    OperatorAbort,
    Order,
    RecordLost,
    StopConfirmed,
    StopUnconfirmed,
    Tick,
)
from perchhw.supervisor.limits import Allowed, SafetyLimits, allowed_limits
from perchhw.supervisor.machine import initial_state, step
from perchhw.supervisor.observation import Observation
from perchhw.supervisor.state import FlightState, Mission, Phase, Step, Timing
from perchhw.supervisor.violation import Violation

__all__ = [
    "Allowed",
    "CommandDone",
    "CommandFailed",
    "Event",
    "FlightState",
    "InternalError",
    "LinkDown",
    "Mission",
    "Observation",
    "OperatorAbort",
    "Order",
    "Phase",
    "RecordLost",
    "SafetyLimits",
    "Step",
    "StopConfirmed",
    "StopUnconfirmed",
    "Tick",
    "Timing",
    "Violation",
    "allowed_limits",
    "initial_state",
    "step",
]
