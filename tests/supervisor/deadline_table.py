"""The phases' deadlines as docs/safety.md shows them, made from what the tests demand of the code."""

from perchhw.supervisor import Phase, Timing
from tests.lab_file.range_tables import table

from .simulated_attempt import MISSION
from .test_deadlines import DEADLINES

_TIMING = Timing()
_MARGIN = f"{_TIMING.move_margin:g} s"
_OF_THE_FLIGHT = {
    Phase.TAKING_OFF: f"{_TIMING.take_off:g} s for the take-off, and {_MARGIN}",
    Phase.MOVING_TO_START: f"the room's length at {MISSION.transit_speed:g} m/s, and {_MARGIN}",
    Phase.APPROACHING: f"the planned approach, and {_TIMING.approach_margin:g} s",
    Phase.TEST_FLIGHT: f"the course, and {_TIMING.course_margin:g} s",
    Phase.LANDING: f"{_TIMING.land:g} s for the descent, and {_TIMING.land_margin:g} s",
}
_THEN = {Phase.DONE: "the attempt ends", Phase.STOPPING: "stopping: the motors are cut"}
_TOLD = {Phase.CHECKING: "every check that does not hold"}


def deadline_table() -> str:
    """Every phase that has a deadline, how long it may take, and what comes of it."""
    rows = [("phase", "deadline", "what follows", "what the reason says")]
    rows += [
        (
            phase.value,
            _OF_THE_FLIGHT.get(phase, f"{seconds:g} s"),
            _THEN.get(then, then.value),
            _TOLD.get(phase, reason) or "(no abort)",
        )
        for phase, seconds, then, _, reason in DEADLINES
    ]
    return table(rows)
