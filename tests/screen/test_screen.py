"""The screen on a real terminal with invented flights: what is shown where, keys, and every way out."""

import json
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from perchhw.record import read_run
from perchhw.screen.screen import Screen
from tests.screen.terminal import Terminal
from tests.tiers import some

Told = list[dict[str, Any]]
Open = Callable[..., Terminal]


def told(folder: Path) -> Told:
    """What the host has said so far."""
    file = folder / "told"
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def find(folder: Path, key: str) -> dict[str, Any] | None:
    return next((one for one in reversed(told(folder)) if key in one), None)


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Open]:
    """Opens the host on a terminal."""
    terminals: list[Terminal] = []

    def open_terminal(scene: str = "fly", **options: Any) -> Terminal:
        terminals.append(Terminal(str(tmp_path), scene, module="tests.screen.host", **options))
        return terminals[-1]

    yield open_terminal
    for terminal in terminals:
        terminal.__exit__(None, None, None)


def test_a_day_at_120_columns(opened: Open, tmp_path: Path) -> None:
    """Pause and notes, a prompt in its place, `l` that lands however often, space that stops."""
    terminal = opened(columns=120, lines=30)
    rows = terminal.until("attempt 1 of 2, 2.5 m/s, 50 deg")
    terminal.until(" Hz, age 10 ms")
    rows = terminal.until("waits for the checks")
    assert rows[1].startswith("▶ check ○ upload ○ arm ○ take-off ○ to start")
    assert "waits for the checks" in rows[2]
    for reading in ("3.92 V", "silent 10 ms", "age 10 ms, OK", "2.0 cm", "1a2b3c4d"):
        assert any(reading in row for row in rows), reading
    assert rows[-1].startswith(" space  stop now   l  land   p  pause after attempt   n  note")
    assert set(rows[-4]) == {"─"}
    assert rows[-3] == rows[-2] == ""

    terminal.press("n")
    terminal.until("1 to be noted after this attempt")
    terminal.press("p")
    terminal.until("paused after this attempt")
    (tmp_path / "end1").touch()
    terminal.until("Note on checking:")
    terminal.press("left leg slipped é\x7fe\r")
    terminal.until("Paused: make ready for the next one, then press Enter")
    terminal.press("n")
    terminal.until("Note on the last attempt:")
    terminal.press("new pads\r")
    terminal.until("Paused:")
    terminal.press("\r")
    rows = terminal.until("Take the drone off the ceiling, then press Enter")
    assert rows[-3].startswith("Take the drone off")
    assert "four_leg 1" in "\n".join(rows)
    terminal.press("\r")
    rows = terminal.until("attempt 2 of 2")
    terminal.wait(lambda: terminal.shown()[-3] == "", what="an empty place for questions")
    terminal.until("waits for the checks")  # before its flight has begun there is nothing to land

    terminal.press("l")
    terminal.wait(lambda: find(tmp_path, "count"))
    terminal.until("▲ KEEP AWAY")
    terminal.press("ll")
    terminal.press("n")
    terminal.until("1 to be noted")
    assert find(tmp_path, "count")["count"] == 1
    assert find(tmp_path, "stopped") is None
    terminal.press(" ")
    terminal.wait(lambda: find(tmp_path, "stopped"))
    terminal.until("Note on landing:")
    terminal.press("\x1b")
    assert terminal.ended() == 0
    notes = [(event["phase"], event["text"]) for event in events(tmp_path / "run1", "note")]
    assert notes == [("checking", ""), ("checking", "left leg slipped e"), ("checking", "new pads")]
    assert [event["text"] for event in events(tmp_path / "run2", "note")] == ["", ""]


def test_words_are_asked_for_also_after_a_key_has_ended_the_flight(opened: Open, tmp_path: Path) -> None:
    """Keys that are still held are no words; whoever ends it once more leaves the notes without."""
    terminal = opened("interrupted")
    terminal.until("attempt 1 of 2")
    terminal.press("n")
    terminal.until("1 to be noted")
    terminal.press("n")
    terminal.until("2 to be noted")
    terminal.press("   ")
    terminal.until("Note on checking:")
    terminal.press("  left leg slipped \r")
    terminal.wait(lambda: len(events(tmp_path / "run1", "note")) == 3, what="the words")
    terminal.until("Note on checking: _")
    terminal.process.send_signal(signal.SIGTERM)
    assert terminal.ended() == -signal.SIGINT
    assert [event["text"] for event in events(tmp_path / "run1", "note")] == ["", "", "left leg slipped"]


def events(folder: Path, name: str) -> list[dict[str, Any]]:
    return [event for event in read_run(folder).events if event["event"] == name]


@pytest.mark.further
def test_a_terminal_that_takes_nothing(opened: Open, tmp_path: Path) -> None:
    """Paused by Ctrl-S: the flight's loop goes on, space stops, and the command can be ended."""
    terminal = opened()
    terminal.until("attempt 1 of 2")
    terminal.press("\x13")
    terminal.wait(lambda: terminal.silent_for(1.0), what="a screen that is stuck")
    terminal.press(" ")
    terminal.wait(lambda: find(tmp_path, "stopped"))
    terminal.wait(lambda: find(tmp_path, "longest"))
    assert find(tmp_path, "longest")["longest"] < 2.0
    shown = terminal.text()
    terminal.press("   ")  # nothing flies: there is no next attempt
    terminal.wait(lambda: not terminal.children(), what="the end of a screen that is stuck")
    assert terminal.text() == shown
    terminal.press("\x11")
    assert terminal.ended() == -signal.SIGINT


@pytest.mark.parametrize("key", some(["\x1a", "\x1c"], 2))
def test_what_suspends_or_kills_a_program_lands_it_and_ends_it_in_order(
    opened: Open, tmp_path: Path, key: str
) -> None:
    terminal = opened()
    terminal.until("waits for the checks")
    terminal.press(key)
    terminal.wait(lambda: find(tmp_path, "count"))
    assert find(tmp_path, "count")["count"] == 1
    (tmp_path / "end1").touch()
    terminal.until("then press Enter")
    terminal.press(key)
    assert terminal.ended() == -signal.SIGINT


def test_a_screen_that_dies_leaves_lines_and_the_flight(opened: Open, tmp_path: Path) -> None:
    terminal = opened()
    terminal.until("attempt 1 of 2")
    (child,) = terminal.children()
    os.kill(child, signal.SIGKILL)
    terminal.until("the screen has ended")
    assert terminal.restored()
    terminal.process.send_signal(signal.SIGINT)
    terminal.wait(lambda: find(tmp_path, "count"))
    terminal.until("KEEP AWAY")
    (tmp_path / "end1").touch()
    terminal.until("Take the drone off the ceiling, then press Enter.")
    terminal.press("\n")
    terminal.until("attempt 2 of 2: 2.5 m/s, 50 deg")
    (tmp_path / "end2").touch()
    assert terminal.ended() == 0


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGTERM,
        signal.SIGKILL,
        pytest.param(signal.SIGHUP, marks=pytest.mark.soak),
        pytest.param(signal.SIGINT, marks=pytest.mark.soak),
    ],
)
def test_the_terminal_is_as_before_however_it_ends(
    opened: Open, tmp_path: Path, number: signal.Signals
) -> None:
    """While a question waits; in a flight the same signals land."""
    terminal = opened()
    terminal.until("attempt 1 of 2")
    (tmp_path / "end1").touch()
    terminal.until("then press Enter")
    terminal.process.send_signal(number)
    assert terminal.ended() == -(signal.SIGKILL if number == signal.SIGKILL else signal.SIGINT)


def test_an_exception_of_ours_is_read_after_the_screen(opened: Open, tmp_path: Path) -> None:
    terminal = opened("raise")
    terminal.until("attempt 1 of 2")
    (tmp_path / "raise").touch()
    assert terminal.ended() == 1
    terminal.until("RuntimeError: an error of ours")


def test_what_is_said_before_each_attempt_stands_there_once() -> None:
    screen = Screen("campaign trial", "udp://127.0.0.1:1")
    for text in ("not asked: put it back", "a new pack", "not asked: put it back"):
        screen.say(text)
    assert screen._snapshot().messages == ("not asked: put it back", "a new pack")
