"""A rehearsal as a record that grows, for a view that follows it. It never ends the rehearsal."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from onboard.app_interface import LandingState, Log
from onboard.arrays import Vector
from onboard.timebase import Timebase
from perchhw.flight.recording import FlightRecorder
from perchhw.record import RunRecorder

if TYPE_CHECKING:
    from onboard.link import LogSample

CUES = {
    Log.TAU: "tau",
    Log.THETA_X: "theta_x",
    Log.D_CEIL: "d_ceil",
    Log.TRIGGER_VALUE: "trigger_value",
    Log.A_ROT: "a_rot",
}
"""What the drone is asked for: its name, and the field of the topic ``cues``."""
_ESTIMATE = ("x", "y", "z", "vx", "vy", "vz")
_LEVEL = {"qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}


class RehearsalRecord:
    """Writes what the drone says, and the poses that it was sent.

    Args:
        record: where it goes; one that is lost is not written any more.
        time: clock of the rehearsal.
    """

    def __init__(self, record: FlightRecorder, time: Timebase) -> None:
        self._record = record
        self._time = time
        self._state: LandingState | None = None

    def take_pose(self, position: Vector) -> None:
        """A position that was sent, m; the drone on its desk is level."""
        place = dict(zip("xyz", position, strict=True))
        self._record.write("pose", self._time(), {**place, **_LEVEL, "verdict": "ok"})

    def take_state(self, estimate: Sequence[float], state: LandingState) -> None:
        """What the drone believes (m, m/s), and where its landing stands."""
        now = self._time()
        self._record.write("estimate", now, dict(zip(_ESTIMATE, estimate, strict=True)))
        self._record.write("cues", now, {"state": float(state)})
        if state is not self._state:
            self._state = state
            self._record.event("phase", now, phase=f"rehearsal: {state.name.lower().replace('_', ' ')}")

    def take_cues(self, sample: "LogSample") -> None:
        """What the drone sees and would do."""
        values = {field: float(sample.values[name]) for name, field in CUES.items()}
        self._record.write("cues", self._time(), values)


OpenRecord = Callable[[Timebase], AbstractContextManager[RehearsalRecord]]
"""Opens the record of a rehearsal on its clock."""


def record_in(folder: Path, config: dict[str, Any]) -> OpenRecord:
    """A record in the run `folder`, with `config` in its ``run.json``."""

    @contextmanager
    def opened(time: Timebase) -> Iterator[RehearsalRecord]:
        with RunRecorder(folder, config, time) as recorder, FlightRecorder(recorder) as record:
            try:
                yield RehearsalRecord(record, time)
            finally:
                record.close()  # the drone still sends

    return opened
