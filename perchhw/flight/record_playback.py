"""A record played to a listener: one that grows as it grows, a finished one at the pace of its flight."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from calibration.flights.growing_run import GrowingRun
from calibration.flights.run_folder import RunRecord
from onboard.timebase import WALL, Timebase
from perchhw.flight.recording import RecordListener

LOOK_PERIOD_S = 0.05


def play_record(
    folder: Path, listener: RecordListener, seconds: float = float("inf"), time: Timebase = WALL
) -> None:
    """Play the record in `folder` to `listener`, until it ends or so many `seconds` have passed.

    Of a record that grows, what is there already is told at once.

    Raises:
        RunFolderError: no run, or damaged.
    """
    run = GrowingRun(folder)
    record, begin, pause = run.look(), time(), time.event()
    flown, first = run.closed, None
    while True:
        for t, tell in _in_order(record, listener):
            first = t if first is None else first
            early = t - first - (time() - begin)
            if flown and t - first > seconds:
                return
            if flown and early > 0.0:
                pause.wait(early)
            tell()
        if run.closed or time() - begin > seconds:
            return
        pause.wait(LOOK_PERIOD_S)
        record = run.look()


def _in_order(record: RunRecord, listener: RecordListener) -> Iterator[tuple[float, Callable[[], None]]]:
    """Times (s, the run's clock) and what is to be told then."""
    told: list[tuple[float, Callable[[], None]]] = []
    for topic, series in record.series.items():
        for t, values in zip(series.t.tolist(), series.messages, strict=True):
            told.append((t, partial(listener.write, topic, t, values)))
    for event in record.events:
        fields = {name: value for name, value in event.items() if name not in ("t", "event")}
        told.append((event["t"], partial(listener.event, event["event"], event["t"], fields)))
    yield from sorted(told, key=lambda item: item[0])
