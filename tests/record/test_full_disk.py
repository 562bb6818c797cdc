"""A full disk: said before a flight with its figure, and in one sentence where it fills up in flight."""

import errno
import json
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from onboard.atomic_file import write_atomically
from onboard.record import recorder
from perchhw.cli.exit_codes import SAFETY
from perchhw.cli.main import run
from perchhw.flight.explain import explain
from perchhw.flight.recording import FlightRecorder
from perchhw.record import RunRecorder, read_run
from perchhw.report.run_report import report_flight
from tests.campaign.conftest import CAMPAIGN

_FILLS_UP = """
import resource, sys
from pathlib import Path
from perchhw.flight.recording import FlightRecorder
from perchhw.record import RunRecorder

record = FlightRecorder(RunRecorder(Path(sys.argv[1]), {}))
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))  # as a disk with no room for more
for index in range(1000):
    record.write("power", 0.001 * index, {"vbat": 4.0})
record.settle()
print(lost := record.look_for_loss())
record.close(outcome="aborted", aborted_by=lost)
"""


def test_a_nearly_full_disk_is_refused_with_its_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "SPACE", 10**17)
    with pytest.raises(recorder.RecordError, match=r"disk_free: \d+ MB, need at least 100000000000 MB"):
        RunRecorder(tmp_path / "run", {})
    assert not any((tmp_path / "run").iterdir())


@pytest.mark.usefixtures("own_drone_files")
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


def _no_space() -> OSError:
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _fill(folder: Path) -> None:
    """As another program that writes until nothing more fits."""
    for size in (65_536, 4096):
        with pytest.raises(OSError, match="No space left"), (folder / "other").open("ab", 0) as other:  # noqa: PT012
            while True:
                other.write(bytes(size))


@pytest.fixture
def small_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "none", str(disk)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("only who may mount a file system can have one that is really full")
    monkeypatch.setattr(recorder, "SPACE", 0)
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def test_a_really_full_disk_keeps_how_the_flight_ended(
    small_disk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = small_disk / "run"
    record = FlightRecorder(RunRecorder(folder, {}))
    record.event("phase", 0.0, phase="taking_off")
    assert record.settle()
    _fill(small_disk)
    for index in range(200):
        record.write("power", 0.001 * index, {"vbat": 4.0})
    assert record.settle()
    lost = record.look_for_loss()
    assert lost is not None
    record.close(outcome="aborted", aborted_by=f"record_lost: {lost}")
    _fill(small_disk)
    info = json.loads((folder / "run.json").read_text())
    assert (info["closed"], info["outcome"], info["record_lost"]) == (True, "aborted", lost)
    told = explain(folder)
    assert told is not None
    assert told["code"] == "record_lost"
    report_flight(folder)
    assert run(["--json", "log", "report", str(folder)]) == 2
    said = capsys.readouterr()
    assert json.loads(said.out)["diagnosis"]["code"] == "record_lost"
    assert f"{folder}: cannot be written (No space left on device)" in said.err
    assert {file.name for file in folder.iterdir()} == {"run.json", "series.mcap", "events.jsonl"}
    (small_disk / "other").unlink()
    assert run(["--json", "log", "report", str(folder)]) == 0
    assert json.loads(capsys.readouterr().out)["diagnosis"]["code"] == "record_lost"


@pytest.mark.parametrize("writes_in_place", [True, False])
def test_the_last_run_json_needs_no_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, writes_in_place: bool
) -> None:
    """A full disk takes what is written over the reserve, or something new once that is gone."""
    folder = tmp_path / "run"
    reserve = folder / recorder.RESERVE_FILE

    def write(path: Path, text: str, room: Path | None = None) -> None:
        if room is None and reserve.exists():
            raise _no_space()
        if room is not None and not writes_in_place:
            room.unlink()
            raise _no_space()
        write_atomically(path, text, room)

    record = RunRecorder(folder, {})
    assert reserve.stat().st_size == 65_536
    monkeypatch.setattr("onboard.json_file.write_atomically", write)
    with pytest.raises(recorder.RecordError, match="No space left"):
        record.update(policy_crc32=17)
    record.close(outcome="aborted", record_lost="full")
    assert not reserve.exists()
    written = read_run(folder)
    assert written.closed
    assert written.info["record_lost"] == "full"


def test_a_disk_that_has_room_again_leaves_no_part_of_a_message_before_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = RunRecorder(tmp_path / "run", {})
    record.write("power", 0.0, {"vbat": 4.0})
    write, room = os.write, 20

    def almost_full(descriptor: int, data: bytes) -> int:
        nonlocal room
        if room == 0:
            raise _no_space()
        written = write(descriptor, data[:room])
        room -= written
        return written

    with monkeypatch.context() as full:
        full.setattr("onboard.record.recorder.os.write", almost_full)
        with pytest.raises(recorder.RecordError, match="No space left"):
            record.write("power", 0.1, {"vbat": 3.9})
    record.close()
    whole = read_run(tmp_path / "run")
    assert whole.torn == ()
    assert whole.series["power"].numbers("vbat").tolist() == [4.0]


def test_a_record_whose_end_the_disk_did_not_take_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = RunRecorder(tmp_path / "run", {})
    record.write("power", 0.0, {"vbat": 4.0})

    def full(_descriptor: int, _data: bytes) -> int:
        raise _no_space()

    with monkeypatch.context() as context:
        context.setattr("onboard.record.recorder.os.write", full)
        with pytest.raises(recorder.RecordError, match="No space left"):
            record.close(outcome="four_leg")
    info = json.loads((tmp_path / "run/run.json").read_text())
    assert info["closed"] is True
    assert "cannot be written any more (No space left on device)" in info["record_lost"]


def test_what_is_left_of_a_reserve_does_no_harm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A killed writer leaves it."""
    record = RunRecorder(tmp_path / "run", {})
    record.write("power", 0.0, {"vbat": 4.0})
    assert (tmp_path / "run" / recorder.RESERVE_FILE).exists()
    assert run(["--json", "log", "list", str(tmp_path)]) == 0
    (listed,) = json.loads(capsys.readouterr().out)["runs"]
    assert listed["closed"] is False
    assert run(["--json", "log", "report", str(tmp_path / "run")]) == 0
    assert json.loads(capsys.readouterr().out)["diagnosis"]["code"] == "process_killed"
    record.close()


def test_a_page_that_finds_no_room_is_told_beside_the_diagnosis(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = tmp_path / "run"
    with RunRecorder(folder, {}) as record:
        record.close(outcome="aborted", record_lost="full")

    def full(_path: int) -> None:
        raise _no_space()

    monkeypatch.setattr("onboard.atomic_file.os.fsync", full)
    told = explain(folder)
    assert told is not None
    assert told["code"] == "record_lost"
    with caplog.at_level(logging.ERROR):  # what is seen without --verbose
        report_flight(folder)
    assert f"no report of {folder}" in caplog.text
    assert run(["log", "report", str(folder)]) == 2
    said = capsys.readouterr()
    assert said.out.startswith("the record was lost: full")
    assert "No space left on device" in said.err
    assert {file.name for file in folder.iterdir()} == {"run.json", "series.mcap", "events.jsonl"}
