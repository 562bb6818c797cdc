"""The one time of a view: seconds since the record began, on the run's clock."""

from typing import TYPE_CHECKING

import numpy as np

from onboard.arrays import FloatArray

if TYPE_CHECKING:
    import rerun

TIMELINE = "flight_time"


class Canvas:
    """A Rerun recording with the clock of one run.

    Args:
        stream: where everything goes.
        begin: the run's clock when the record began, s.
    """

    def __init__(self, stream: "rerun.RecordingStream", begin: float) -> None:
        self.stream = stream
        self._begin = begin

    def static(self, entity: str, what: "rerun.AsComponents") -> None:
        """Draw what does not change."""
        self.stream.log(entity, what, static=True)

    def columns(self, entity: str, t: FloatArray, columns: "rerun.ComponentColumnList") -> None:
        """Draw what has one row for each of the times `t` (n,), s on the run's clock; none draws nothing."""
        import rerun as rr

        if t.size:
            index = rr.TimeColumn(TIMELINE, duration=t - self._begin)
            self.stream.send_columns(entity, indexes=[index], columns=columns)

    def curve(self, entity: str, t: FloatArray, values: FloatArray) -> None:
        """Points of a curve, (n,) each; what is no number is left out."""
        import rerun as rr

        known = ~np.isnan(values)
        self.columns(entity, t[known], rr.Scalars.columns(scalars=values[known]))

    def trail(self, entity: str, t: FloatArray, points: FloatArray) -> None:
        """A point (n, 3) for each time; how far back they are seen is the blueprint's matter."""
        import rerun as rr

        self.columns(entity, t, rr.Points3D.columns(positions=points))

    def cleared(self, entity: str, t: float) -> None:
        """Take what was drawn away at the time `t`, s on the run's clock."""
        import rerun as rr

        self.stream.set_time(TIMELINE, duration=t - self._begin)
        self.stream.log(entity, rr.Clear(recursive=False))
        self.stream.reset_time()
