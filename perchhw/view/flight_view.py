"""A run as a Rerun recording, drawn as its record grows: a recorded flight is one that grows at once."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from onboard.policy.model import Policy
from onboard.record.growing_run import GrowingRun
from onboard.record.run_record import RunRecord
from onboard.vehicle import Vehicle
from perchhw.record.flown import policy_of, vehicle_of
from perchhw.record.wall_time import begin_of
from perchhw.view.cue_space import CueSpace
from perchhw.view.plots import Plots
from perchhw.view.scene import Scene
from perchhw.view.timeline import Canvas
from perchhw.view.words import Words

if TYPE_CHECKING:
    import rerun

LOOK_PERIOD_S = 0.2
"""Between two looks at a record that grows, s."""


class FlightView:
    """Draws one run.

    Args:
        stream: the recording.
        run: the run that is drawn; what it holds by now comes by :meth:`add`.
        vehicle: its geometry is drawn.
        policy: whose trigger is drawn, or None.
    """

    def __init__(
        self, stream: "rerun.RecordingStream", run: RunRecord, vehicle: Vehicle, policy: Policy | None
    ) -> None:
        canvas, config = Canvas(stream, begin_of(run)), run.config
        parts = (Scene(canvas, config, vehicle), CueSpace(canvas, policy), Plots(canvas), Words(canvas))
        self._parts = parts

    def add(self, news: RunRecord) -> None:
        """Draw what came since the last call."""
        for part in self._parts:
            part.add(news)


def follow(
    run: GrowingRun,
    stream: "rerun.RecordingStream",
    wait: Callable[[float], object],
    over: Callable[[], bool],
    taken: Callable[[], None],
) -> None:
    """Draw a run until its writer has closed it, or `over` says that nobody writes it any more.

    Args:
        run: nothing of it was looked at yet.
        stream: where it is drawn.
        wait: waits for so long, s.
        over: asked before each look.
        taken: waits until all that was drawn has arrived.

    Raises:
        RunFolderError: damaged.
        VehicleFileError: the vehicle of the run is not known here.
    """
    news = run.look()
    view = FlightView(stream, news, vehicle_of(news.config), policy_of(news))
    view.add(news)
    while not run.closed and not over():
        taken()
        wait(LOOK_PERIOD_S)
        view.add(run.look())
    view.add(run.look())
    taken()
