"""The record is put on the disk while the flight goes on, and a disk that refuses is told."""

import errno
import os
import threading
from pathlib import Path

import pytest

from onboard.record.sync import PeriodicSync
from perchhw.record import RecordError, RunRecorder
from perchhw.record.run import read_run

PATIENCE_S = 60.0


def test_files_are_synced_again_and_again_and_once_more_at_the_end() -> None:
    calls: list[int] = []
    thrice = threading.Event()

    def sync(descriptor: int) -> None:
        calls.append(descriptor)
        if calls.count(7) == 3:
            thrice.set()

    syncing = PeriodicSync((7, 8), sync, period_s=0.001)
    assert thrice.wait(PATIENCE_S)
    syncing.stop()
    assert calls[-2:] == [7, 8]
    assert set(calls[::2]) == {7}
    ended = len(calls)
    assert not threading.Event().wait(0.01)
    assert len(calls) == ended


def test_closing_puts_everything_on_the_disk(tmp_path: Path) -> None:
    synced: dict[str, int] = {}

    def sync(descriptor: int) -> None:
        os.fsync(descriptor)
        synced[Path(f"/proc/self/fd/{descriptor}").readlink().name] = os.fstat(descriptor).st_size

    with RunRecorder(tmp_path / "run", {}, sync=sync) as recorder:
        recorder.write("rates", 1.0, {"gx": 0.5})
        recorder.event("phase", 1.0, phase="hover")
    sizes = {name: (tmp_path / "run" / name).stat().st_size for name in ("series.mcap", "events.jsonl")}
    assert synced == sizes


def test_a_disk_that_refuses_ends_the_record_and_says_so(tmp_path: Path) -> None:
    def refuse(descriptor: int) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    recorder = RunRecorder(tmp_path / "run", {}, sync=refuse)
    recorder.write("rates", 1.0, {"gx": 0.5})
    recorder._sync.stop()
    with pytest.raises(RecordError, match=r"the disk does not take the record \(Input/output error\)"):
        recorder.write("rates", 2.0, {"gx": 0.5})
    recorder.close()
    assert [message["gx"] for message in read_run(tmp_path / "run").series["rates"].messages] == [0.5]
