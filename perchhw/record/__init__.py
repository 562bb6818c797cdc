"""The record of a run: a folder that survives a killed process. Format: ``docs/records.md``."""

from calibration.flights.run_folder import RunRecord, Series, read_run
from perchhw.record.folder import new_run_folder
from perchhw.record.recorder import RecordError, RunRecorder
from perchhw.record.topics import TOPICS

__all__ = ["TOPICS", "RecordError", "RunRecord", "RunRecorder", "Series", "new_run_folder", "read_run"]
