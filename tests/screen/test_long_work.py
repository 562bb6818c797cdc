"""Long work without a terminal says what it does, a line per change; on a terminal it keeps to one line."""

from io import StringIO

import pytest
from rich.console import Console

from perchhw.screen.long_work import activity, share_done


def test_without_a_terminal_every_change_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with activity("reading") as tell:
        tell("sensors")
        tell("every effect [about 3 s a round]")
    said = capsys.readouterr()
    assert said.err.splitlines() == ["reading", "sensors", "every effect [about 3 s a round]"]
    assert said.out == ""


def test_without_a_terminal_every_tenth_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    with share_done("learning trials") as tell:
        for done in range(31):
            tell(done, 30)
            tell(done, 30)
    said = capsys.readouterr().err.splitlines()
    assert said == [f"learning trials: {share} %" for share in range(10, 101, 10)]


def test_a_terminal_has_a_bar() -> None:
    shown = StringIO()
    with share_done("learning trials", Console(file=shown, force_terminal=True, width=80)) as tell:
        tell(15, 30)
    assert "50%" in shown.getvalue()
