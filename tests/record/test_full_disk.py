"""A full disk: said before a flight with its figure, and in one sentence where it fills up in flight."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from perchhw.record import RunRecorder, recorder

_FILLS_UP = """
import resource, sys
from pathlib import Path
from perchhw.flight.recording import FlightRecord
from perchhw.record import RunRecorder

resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))  # as a disk with no room for more
record = FlightRecord(RunRecorder(Path(sys.argv[1]), {}))
for index in range(1000):
    record.write("power", 0.001 * index, {"vbat": 4.0})
print(record.lost)
record.close(outcome="aborted", aborted_by=record.lost)
"""


def test_a_nearly_full_disk_is_refused_with_its_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "SPACE", 10**17)
    with pytest.raises(recorder.RecordError, match=r"disk_free: \d+ MB, need at least 100000000000 MB"):
        RunRecorder(tmp_path / "run", {})
    assert not any((tmp_path / "run").iterdir())


def test_a_disk_that_fills_up_is_one_sentence_and_no_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-c", _FILLS_UP, str(tmp_path / "run")]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 0, ended.stderr
    assert "cannot be written any more (File too large): make room" in ended.stdout
    assert "Traceback" not in ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    info = json.loads((tmp_path / "run/run.json").read_text())
    assert info["closed"] is True
    assert info["outcome"] == "aborted"
    assert info["aborted_by"] == ended.stdout.strip()
