"""Records of runs: read as tables, listed, exported, in words; :mod:`onboard.record` writes them."""

from onboard.record.folder import OutputFolderError, discard_if_empty, new_run_folder
from onboard.record.recorder import RecordError, RunRecorder
from onboard.record.run_record import RunRecord, Series
from onboard.record.topics import TOPICS
from perchhw.record.run import read_run

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
