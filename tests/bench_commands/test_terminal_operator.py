"""What a person types at a wizard's prompts, on a terminal."""

import os
import pty
from collections.abc import Iterator

import pytest

from calibration.bench.procedures.operator import Paused, StepAgain, Task
from perchhw.cli.bench_operator import TerminalOperator

CTRL_D = b"\x04"


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """What is written here has been typed."""
    keys, terminal = pty.openpty()
    with os.fdopen(terminal, encoding="utf-8") as typed:
        monkeypatch.setattr("sys.stdin", typed)
        yield keys
    os.close(keys)


def test_only_enter_says_that_a_task_is_done(keyboard: int, capsys: pytest.CaptureFixture[str]) -> None:
    os.write(keyboard, b"x\nrr\n\n")
    TerminalOperator().do(Task("power", "Put the battery in."))
    said = capsys.readouterr().err
    assert "'x' is none of these keys" in said
    assert "'rr' is none of these keys" in said
    os.write(keyboard, b"x\nR\n")
    with pytest.raises(StepAgain):
        TerminalOperator().do(Task("power", "Put the battery in."))


def test_the_end_of_the_input_pauses(keyboard: int) -> None:
    os.write(keyboard, CTRL_D)
    with pytest.raises(Paused, match="the same command goes on"):
        TerminalOperator().do(Task("power", "Put the battery in."))
    os.write(keyboard, CTRL_D)
    with pytest.raises(Paused):
        TerminalOperator().agree("Apply it?")
