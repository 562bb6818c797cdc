"""What a person types at a wizard's prompts, on a terminal."""

import os
import pty
from collections.abc import Iterator
from pathlib import Path

import pytest

from calibration.bench.procedures.operator import Paused, Question, StepAgain, Task
from calibration.bench.procedures.run_book import RunBook
from perchhw.cli.bench_operator import TerminalOperator
from perchhw.cli.bench_options import run_folder
from perchhw.cli.exit_codes import INTERRUPTED
from perchhw.cli.main import run

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
    operator = TerminalOperator()
    operator.begin("Power", 1)
    operator.do(Task("power", "Put the battery in."))
    said = capsys.readouterr().err
    assert "'x' is none of these keys" in said
    assert "'rr' is none of these keys" in said
    os.write(keyboard, b"x\nR\n")
    with pytest.raises(StepAgain):
        operator.do(Task("power", "Put the battery in."))


def test_who_pauses_is_told_how_to_go_on(
    keyboard: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    os.write(keyboard, b"r\nq\n")
    assert run(["calibrate", "bifilar", "--drone", "udp://127.0.0.1:1"]) == INTERRUPTED
    said = " ".join(capsys.readouterr().err.split())
    assert "'r' is none of these keys" in said  # no step has begun that could be done again
    assert "error" not in said
    assert said.endswith("no step is done yet: the same command begins anew paused")
    folder = tmp_path / "run"
    RunBook(folder, "bifilar", {}, TerminalOperator()).step("weigh", "Weigh it", dict)
    with pytest.raises(Paused), run_folder(folder, "bifilar"):
        raise Paused("paused")
    assert f"the same command with --out {folder} goes on" in " ".join(capsys.readouterr().err.split())


def test_the_end_of_the_input_pauses(keyboard: int, capsys: pytest.CaptureFixture[str]) -> None:
    os.write(keyboard, CTRL_D)
    with pytest.raises(Paused, match="the input has ended"):
        TerminalOperator().do(Task("power", "Put the battery in."))
    os.write(keyboard, CTRL_D)
    with pytest.raises(Paused):
        TerminalOperator().agree("Apply it?")
    assert capsys.readouterr().err.endswith("Apply it? [y/N]: \n")


@pytest.mark.parametrize(
    ("readings", "typed", "found"),
    [
        (1, b"12,5\n12.5\n", [0.0125]),  # was taken for 12 g and 5 g
        (1, b"38,10 g\n38.10 g\n", [0.0381]),
        (3, b"600,4\n600.4, 600.2, 600.3\n", [0.6004, 0.6002, 0.6003]),
    ],
)
def test_a_decimal_comma_is_not_taken_for_two_readings(
    readings: int, typed: bytes, found: list[float], keyboard: int, capsys: pytest.CaptureFixture[str]
) -> None:
    os.write(keyboard, typed)
    question = Question("mass", "what the scale showed", "kg", "g", (-0.5, 2.0), 0.0, readings)
    assert TerminalOperator().measure(question) == pytest.approx(found)
    assert "decimals follow a point" in " ".join(capsys.readouterr().err.split())
