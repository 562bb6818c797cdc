"""How long the drone's control loop takes, as its firmware measures it while it rehearses."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from onboard.link import DroneLink, LogSample

LOOP_TIME = "stabilizer.intToOut"
"""us from the sensors' interrupt to the end of the control loop's step (``stabilizer.c``); a simulated drone
has no processor, and says 0."""
PERIOD_MS = 20
"""Of the log, which sees one step in twenty; with what a view asks for it fits the radio."""


@dataclass(frozen=True)
class LoopTime:
    """Steps of the control loop, of those that were seen.

    Attributes:
        mean, most: us.
    """

    mean: float
    most: float


class LoopWatch:
    """Listens to the drone at the end of `link` from now on."""

    def __init__(self, link: "DroneLink") -> None:
        self._times: list[float] = []
        link.stream((LOOP_TIME,), PERIOD_MS, self._take)

    def _take(self, sample: "LogSample") -> None:
        time = float(sample.values[LOOP_TIME])
        if time > 0.0:
            self._times.append(time)

    def told(self) -> LoopTime | None:
        """What came of it; None where no processor was timed."""
        times = self._times
        return LoopTime(sum(times) / len(times), max(times)) if times else None
