"""The book of a run: steps are done once, recordings are never lost or overwritten."""

import errno
import gzip
import hashlib
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from calibration.bench.procedures.operator import Paused, StepAgain, StepBack, StepSkipped, Task
from calibration.bench.procedures.run_book import RunBook, RunBookError
from onboard.record.folder import OutputFolderError
from tests.wizards.quiet_operator import QuietOperator


def write(path: Path, text: str) -> None:
    path.write_bytes(gzip.compress(text.encode()))


def book(folder: Path, operator: QuietOperator | None = None, **settings: object) -> RunBook:
    return RunBook(folder, "bifilar", {"trials": 5, **settings}, operator or QuietOperator())


def test_a_finished_step_is_not_done_again(tmp_path: Path) -> None:
    counted = []
    for _ in range(2):
        result = book(tmp_path).step("weigh", "Weigh", lambda: {"n": counted.append(1) or len(counted)})
    assert result == {"n": 1}


def test_a_run_that_did_nothing_leaves_no_trace(tmp_path: Path) -> None:
    operator = QuietOperator(obstacles={"place": Paused("q")})
    begun = book(tmp_path, operator)
    with pytest.raises(Paused):
        begun.step("place", "Place", lambda: operator.do(Task("place", "place it")))
    assert list(tmp_path.iterdir()) == []


def test_a_pause_keeps_what_was_finished(tmp_path: Path) -> None:
    operator = QuietOperator(obstacles={"twist": Paused("q")})
    first = book(tmp_path, operator)
    first.step("weigh", "Weigh", lambda: {"mass": 0.03})
    with pytest.raises(Paused):
        first.step("trial", "Swing", lambda: operator.do(Task("twist", "twist it")))
    again = book(tmp_path)
    assert again.steps == {"weigh": {"mass": 0.03}}
    assert again.step("trial", "Swing", lambda: {"done": True}) == {"done": True}


def test_a_step_is_repeated_skipped_or_gone_back_from(tmp_path: Path) -> None:
    operator = QuietOperator(obstacles={"twist": StepAgain("r"), "hang": StepSkipped("s")})
    run = book(tmp_path, operator)
    assert run.step("trial", "Swing", lambda: operator.do(Task("twist", "")) or {"good": 1}) == {"good": 1}
    assert run.step("hang", "Hang", lambda: operator.do(Task("hang", ""))) == {}
    assert run.skipped == ["hang"]
    operator.obstacles["fit"] = StepBack("b")
    with pytest.raises(StepBack):
        run.step("fit", "Fit", lambda: operator.do(Task("fit", "")))
    assert list(run.steps) == ["trial"]


def test_recordings_are_hashed_and_never_overwritten(tmp_path: Path) -> None:
    run = book(tmp_path)
    kept = [run.keep_raw("x-1", partial(write, text=f"t_ms,gyro\n0,{n}\n")) for n in range(2)]
    assert kept[0]["file"] != kept[1]["file"]
    for n, one in enumerate(kept):
        data = (tmp_path / one["file"]).read_bytes()
        assert hashlib.sha256(data).hexdigest() == one["sha256"]
        assert gzip.decompress(data).decode() == f"t_ms,gyro\n0,{n}\n"


def test_a_folder_of_another_run_is_refused_and_kept(tmp_path: Path) -> None:
    book(tmp_path).step("weigh", "Weigh", lambda: {"mass": 0.03})
    with pytest.raises(RunBookError, match="is a bifilar run"):
        RunBook(tmp_path, "thrust", {"trials": 5}, QuietOperator())
    with pytest.raises(RunBookError, match="trials was 5"):
        RunBook(tmp_path, "bifilar", {"trials": 3}, QuietOperator())
    assert book(tmp_path).steps == {"weigh": {"mass": 0.03}}


def test_a_damaged_book_is_named(tmp_path: Path) -> None:
    book(tmp_path)
    (tmp_path / "state.json").write_text('{"kind": "bifi')
    with pytest.raises(RunBookError, match="damaged"):
        book(tmp_path)


def test_a_killed_run_loses_the_running_step_only(tmp_path: Path) -> None:
    program = (
        "import sys, time; from pathlib import Path\n"
        "from calibration.bench.procedures.run_book import RunBook\n"
        "from tests.wizards.quiet_operator import QuietOperator\n"
        "run = RunBook(Path(sys.argv[1]), 'bifilar', {'trials': 5}, QuietOperator())\n"
        "for n in range(10**6):\n"
        "    work = lambda: run.keep_raw(f'z-{n}', lambda path: path.write_text('a' * 2000))\n"
        "    run.step(f'trial-{n}', 'Swing', work)\n"
        "    print(n, flush=True)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path)], stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout is not None
        for line in child.stdout:
            if int(line) >= 7:
                break
        os.kill(child.pid, signal.SIGKILL)
        rest = child.stdout.read().split()
    finished = int(rest[-1]) if rest else 7
    steps = book(tmp_path).steps
    assert len(steps) in (finished + 1, finished + 2)
    for one in steps.values():
        assert hashlib.sha256((tmp_path / one["file"]).read_bytes()).hexdigest() == one["sha256"]


def test_nobody_works_for_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    book = RunBook(tmp_path / "file" / "run", "test", {}, QuietOperator())
    worked: list[int] = []
    with pytest.raises(OutputFolderError, match="is no folder"):
        book.step("one", "One", lambda: {"worked": worked.append(1)})
    assert not worked


def test_a_disk_that_takes_no_more_is_an_error_of_ours(tmp_path: Path) -> None:
    book = RunBook(tmp_path / "run", "test", {}, QuietOperator())

    def full(_: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OutputFolderError, match=r"run: cannot be written \(No space left on device\)"):
        book.keep_raw("swing", full)
    (tmp_path / "run" / "state.json").mkdir()
    with pytest.raises(OutputFolderError, match="run: cannot be written"):
        book.step("one", "One", dict)
