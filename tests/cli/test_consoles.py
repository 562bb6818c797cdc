"""What a person reads on a terminal is broken between words; what a program reads is not broken."""

from io import StringIO

import pytest
from rich.console import Console

from perchhw.consoles import in_width

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
