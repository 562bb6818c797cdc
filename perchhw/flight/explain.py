"""What a flight that has just ended leaves in its record: why it was refused, and its diagnosis."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from onboard.clock import Clock
from onboard.errors import PerchhwError
from onboard.json_file import as_json
from onboard.outcome import Outcome
from onboard.record.folder import OutputFolderError
from perchhw.diagnosis import diagnose_run, keep_diagnosis
from perchhw.flight.caught import Caught
from perchhw.flight.recording import FlightRecorder
from perchhw.record.run import read_run

_log = logging.getLogger(__name__)


@contextmanager
def refusal_recorded(record: FlightRecorder, clock: Clock, folder: Path) -> Iterator[None]:
    """An error within, before a flight has begun, closes its record in `folder` as refused, explained."""
    try:
        yield
    except PerchhwError as error:
        record.event("refused", clock(), reason=str(error))
        record.close(outcome=Outcome.ABORTED, aborted_by=str(error))
        explain(folder)
        raise


def explain(folder: Path) -> dict[str, Any] | None:
    """The diagnosis of the run `folder`, as in its ``run.json``; what it fails of costs no result."""

    def untold(error: BaseException) -> None:
        ours = isinstance(error, PerchhwError)
        _log.error("no diagnosis of %s (%s)", folder, error, exc_info=None if ours else error)

    with Caught(untold):
        try:
            return as_json(keep_diagnosis(folder))
        except OutputFolderError as error:  # a full disk: it is told all the same
            _log.error("the diagnosis of %s is not kept in its record (%s)", folder, error)
            return as_json(diagnose_run(read_run(folder)))
    return None
