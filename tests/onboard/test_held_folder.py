"""Temporary folders go with the last process that holds them, and none goes that is in use."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.conftest import REPOSITORY

PREFIX = "held-"
HOLDS = f"""\
import sys
from onboard.held_folder import new_held_folder, take_away_left
take_away_left("{PREFIX}")
held = new_held_folder("{PREFIX}")
print(held.path, flush=True)
sys.stdin.read()
held.let_go()
"""
HOLDS_ANOTHERS = """\
import sys
from pathlib import Path
from onboard.held_folder import hold_folder
held = hold_folder(Path(sys.argv[1]))
print(held.path, flush=True)
sys.stdin.read()
held.let_go()
"""

Start = Callable[..., tuple[subprocess.Popen[str], Path]]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a process that runs until its input ends; gives it and the folder that it holds."""
    with ExitStack() as stack:

        def started(code: str, *arguments: str) -> tuple[subprocess.Popen[str], Path]:
            process = subprocess.Popen(
                [sys.executable, "-c", code, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                env={**os.environ, "TMPDIR": str(tmp_path)},
                cwd=REPOSITORY,
            )
            stack.enter_context(process)
            stack.callback(process.kill)
            assert process.stdout is not None
            return process, Path(process.stdout.readline().strip())

        yield started


def end(process: subprocess.Popen[str]) -> None:
    process.communicate()
    assert process.returncode == 0


def test_what_a_killed_process_left_is_taken_away_by_the_next_and_what_is_in_use_stays(
    start: Start, tmp_path: Path
) -> None:
    living, its = start(HOLDS)
    killed, left = start(HOLDS)
    (left / "full").touch()
    killed.kill()
    killed.wait()
    assert left.is_dir()
    another, third = start(HOLDS)
    assert set(tmp_path.iterdir()) == {its, third}
    end(another)
    assert set(tmp_path.iterdir()) == {its}
    end(living)
    assert not list(tmp_path.iterdir())


def test_it_stays_until_the_last_one_lets_go_of_it(start: Start) -> None:
    maker, folder = start(HOLDS)
    guest, same = start(HOLDS_ANOTHERS, str(folder))
    assert same == folder
    end(maker)
    assert folder.is_dir()
    end(guest)
    assert not folder.exists()


def test_nothing_is_taken_away_behind_a_link_or_of_another_name(start: Start, tmp_path: Path) -> None:
    (precious := tmp_path / "precious").mkdir()
    (link := tmp_path / f"{PREFIX}link").symlink_to(precious)
    (file := tmp_path / f"{PREFIX}file").touch()
    process, _ = start(HOLDS)
    end(process)
    assert {precious, link, file} == set(tmp_path.iterdir())


@pytest.mark.skipif(os.getuid() != 0, reason="only root can make the folder of another user")
def test_another_users_folder_stays(start: Start, tmp_path: Path) -> None:
    (theirs := tmp_path / f"{PREFIX}theirs").mkdir()
    os.chown(theirs, 12345, 12345)
    process, _ = start(HOLDS)
    end(process)
    assert theirs.is_dir()
