"""A run folder while it is being written: what came since the last look. Format: ``docs/records.md``."""

from pathlib import Path
from typing import Any

from onboard.record.run_record import (
    EVENTS_FILE,
    RUN_FILE,
    SERIES_FILE,
    RunFolderError,
    RunRecord,
    read_event,
    read_info,
)
from onboard.record.series_file import GrowingSeries


class GrowingRun:
    """Follows one run folder; reads every byte once and holds no lock, so that its writer notices nothing.

    Args:
        folder: the run folder; ``run.json`` must be there.

    Attributes:
        closed: whether the writer had finished before the last look, which then brought the rest.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.closed = False
        self._series = GrowingSeries(folder / SERIES_FILE)
        self._events_read = 0
        self._lines_read = 0

    def look(self) -> RunRecord:
        """The run with the messages and events that came since the last look; a torn tail waits.

        Raises:
            RunFolderError: damaged, or not a run.
        """
        try:
            if not (self.folder / RUN_FILE).is_file():
                raise RunFolderError(
                    f"{self.folder} is no run: give the folder of one, in which {RUN_FILE} is"
                )
            info = read_info(self.folder)  # before the rest: what was closed does not grow
            series, events = self._series.read(), self._new_events()
        except OSError as error:
            raise RunFolderError(f"{self.folder}: cannot be read ({error.strerror})") from error
        self.closed = bool(info["closed"])
        return RunRecord(self.folder, info, series, tuple(events), ())

    def _new_events(self) -> list[dict[str, Any]]:
        path = self.folder / EVENTS_FILE
        if not path.exists():
            return []
        with path.open("rb") as stream:
            stream.seek(self._events_read)
            *lines, tail = stream.read().split(b"\n")
            self._events_read = stream.tell() - len(tail)
        first = self._lines_read + 1
        self._lines_read += len(lines)
        return [read_event(path, number, line) for number, line in enumerate(lines, start=first)]
