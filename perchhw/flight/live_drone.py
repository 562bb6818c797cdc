"""A drone that somebody looks at without flying it: its logs, told as a record would have them."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from onboard.lab_time import open_timebase
from perchhw.flight.recording import RecordListener
from perchhw.flight.telemetry import TEST_FLIGHT_BLOCKS, TelemetryBlock

if TYPE_CHECKING:
    from onboard.link import LogSample

_LOOK_PERIOD_S = 0.1


def tell_drone(uri: str, listener: RecordListener, seconds: float = float("inf")) -> None:
    """Connect, and tell `listener` the drone's estimate, rates, battery and supervisor at 100 Hz, for so many
    `seconds` of its time.

    Raises:
        DroneInUse: another program of perchhw talks to it.
        LinkError, LinkTimeout: it cannot be reached, or does not log.
        LinkLost: it was lost meanwhile.
    """
    from onboard.link import DroneLink

    with open_timebase("mavlink serve", uri) as time, DroneLink.open(uri, clock=time) as link:
        for block in TEST_FLIGHT_BLOCKS:
            halves = {name for name, field in block.variables.items() if field.half}
            link.stream(tuple(block.variables), block.period_ms, _receiver(block, listener), halves=halves)
        pause, end = time.event(), time() + seconds
        while time() < end:
            pause.wait(min(_LOOK_PERIOD_S, end - time()))
            if link.lost is not None:
                raise link.lost


def _receiver(block: TelemetryBlock, listener: RecordListener) -> "Callable[[LogSample], None]":
    def receive(sample: "LogSample") -> None:
        topics: dict[str, dict[str, float]] = {}
        for variable, field in block.variables.items():
            topics.setdefault(field.topic, {})[field.name] = sample.values[variable] * field.scale
        for topic, values in topics.items():
            listener.write(topic, sample.receipt_time, values)

    return receive
