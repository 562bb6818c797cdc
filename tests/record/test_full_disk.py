"""A full disk: said before a flight with its figure, and in one sentence where it fills up in flight."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from onboard.record import recorder
from perchhw.cli.exit_codes import SAFETY
from perchhw.cli.main import run
from perchhw.record import RunRecorder
from tests.campaign.conftest import CAMPAIGN

_FILLS_UP = """
import resource, sys
from pathlib import Path
from perchhw.flight.recording import FlightRecorder
from perchhw.record import RunRecorder

resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))  # as a disk with no room for more
record = FlightRecorder(RunRecorder(Path(sys.argv[1]), {}))
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


def test_a_campaign_that_finds_the_disk_nearly_full_stops_and_costs_no_attempt(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Not three attempts that count as aborted; by the code of a refusal, with what to do."""
    file = tmp_path / "day.toml"
    file.write_text(CAMPAIGN)
    monkeypatch.setattr("perchhw.flight.turnaround.ask_supervisor", lambda _drone: None)
    monkeypatch.setattr(recorder, "SPACE", 10**17)
    assert run(["campaign", "run", str(file), "--out", str(tmp_path / "c"), "--yes", "--json"]) == SAFETY
    told = json.loads(capsys.readouterr().out)
    assert "make room, or give a folder on another disk (--out); put that right" in told["stopped"]
    assert {(one["state"], one["try_number"]) for one in told["attempts"]} == {("planned", 1)}


def test_a_flight_on_a_nearly_full_disk_is_refused_as_by_a_rule(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before anybody is asked to put the drone back."""
    monkeypatch.setattr(recorder, "SPACE", 10**17)
    where = ["--drone", "udp://127.0.0.1:9", "--mocap", "vicon://127.0.0.1:9?subject=cf1"]
    fly = ["fly", *where, "--speed", "2.5", "--angle", "50", "--out", str(tmp_path / "runs"), "--put-back"]
    assert run([*fly, "--json"]) == SAFETY
    assert "make room, or give a folder on another disk" in json.loads(capsys.readouterr().out)["error"]
    assert not any((tmp_path / "runs").iterdir())


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
