"""What a person reads on a terminal is broken between words; what a program reads is not broken."""

from io import StringIO

import pytest
from rich.console import Console

from perchhw.cli.main import run
from perchhw.consoles import in_width
from tests.screen.terminal import Terminal

SENTENCE = "the body touched first: the flip began 14 ms early"


def screen(terminal: bool) -> Console:
    return Console(file=StringIO(), force_terminal=terminal, width=30)


@pytest.mark.parametrize("mark", ["", "  ! "])
def test_a_terminal_breaks_between_words_and_as_far_in_as_a_line_began(mark: str) -> None:
    lines = in_width(f"  {SENTENCE}", screen(True), mark).splitlines()
    assert len(lines) > 1
    assert max(map(len, lines)) <= 30
    assert [word for line in lines for word in line.removeprefix(mark).split()] == SENTENCE.split()
    assert lines[0].startswith(f"{mark}  t")
    assert all(line.startswith(" " * (len(mark) + 2)) for line in lines[1:])


def test_a_path_stays_whole() -> None:
    path = f"record: {'/long' * 10}"
    assert in_width(path, screen(True)).splitlines()[-1].endswith("/long" * 10)


def test_elsewhere_a_line_stays_one() -> None:
    assert in_width(f"{SENTENCE}\n\n{SENTENCE}", screen(False)) == f"{SENTENCE}\n\n{SENTENCE}"


def test_an_error_is_broken_between_words_on_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["campaign", "status", "no-such-folder-of-a-campaign"]
    assert run(command) == 2
    said = capsys.readouterr().err.split()
    assert len(" ".join(said)) > 40
    with Terminal(*command, columns=40) as terminal:
        assert terminal.ended() == 2
        terminal.wait(lambda: said[-1] in terminal.text(), what="the error")
        assert terminal.text().split() == said
