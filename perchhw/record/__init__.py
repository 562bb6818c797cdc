"""The record of a run: a folder that survives a killed process. Format: ``docs/records.md``."""

from calibration.flights.run_folder import RunRecord, Series, read_run
from perchhw.record.folder import OutputFolderError, discard_if_empty, new_run_folder
from perchhw.record.recorder import RecordError, RunRecorder
from perchhw.record.topics import TOPICS

__all__ = [
    "TOPICS",
    "OutputFolderError",
    "RecordError",
    "RunRecord",
    "RunRecorder",
    "Series",
    "discard_if_empty",
    "new_run_folder",
    "read_run",
]
