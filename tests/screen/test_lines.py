"""What the operator reads without a terminal: each phase and alert once, in order; nobody waits for it."""

import logging
import os
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from perchhw.cli.prompts import confirmation
from perchhw.errors import NobodyToAsk
from perchhw.screen.display import Progress
from perchhw.screen.lines import Lines
from perchhw.supervisor import FlightState, Phase

UNSEEN = "NOT SEEN: mocap has no pose"


def in_phase(phase: Phase, alert: str | None = None) -> FlightState:
    return replace(FlightState(phase=phase, entered_at=0.0), alert=alert)


FLIGHT = [
    in_phase(Phase.FLIPPING),
    in_phase(Phase.SETTLING),
    in_phase(Phase.SETTLING, UNSEEN),
    in_phase(Phase.DISARMING, UNSEEN),
    in_phase(Phase.DONE, UNSEEN),
]
SAID = ["flipping", "settling", UNSEEN, "disarming", "done"]


def read(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return [line.strip("\a ") for line in capsys.readouterr().err.splitlines()]


def test_phases_and_alerts_are_said_once(capsys: pytest.CaptureFixture[str]) -> None:
    with Lines() as lines:
        for state in FLIGHT:
            lines.phase(state)
    assert read(capsys) == SAID


def test_another_alert_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    with Lines() as lines:
        for text in ("A: 1", "B: 2", None, "B: 2"):
            lines.phase(in_phase(Phase.SETTLING, text))
    assert read(capsys) == ["A: 1", "settling", "B: 2", "B: 2"]


def test_attempts_are_counted_and_begin_anew(capsys: pytest.CaptureFixture[str]) -> None:
    with Lines() as lines:
        lines.progress(Progress(attempts=2))
        lines.progress(Progress(attempts=2))
        for number in (1, 2):
            lines.begin(Path(), "2.5 m/s, 50 deg", number)
            for state in FLIGHT:
                lines.phase(state)
        lines.progress(Progress(attempts=2, outcomes=(("four_leg", 1), ("two_leg", 1))))
    begins = [f"attempt {number} of 2: 2.5 m/s, 50 deg" for number in (1, 2)]
    assert read(capsys) == [
        *("0 of 2 done", begins[0], *SAID, begins[1], *SAID),
        "2 of 2 done: four_leg 1, two_leg 1",
    ]


def read_all(descriptor: int) -> None:
    with os.fdopen(descriptor, "rb") as stream:
        stream.read()


def test_a_stderr_that_takes_nothing_holds_nobody_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither phases nor what is logged: a pipe that nobody reads is full after 64 kB."""
    reader, writer = os.pipe()
    full = os.fdopen(writer, "w")
    handler = logging.StreamHandler(full)
    logging.getLogger().addHandler(handler)
    monkeypatch.setattr("sys.stderr", full)
    told = threading.Event()

    def tell(lines: Lines) -> None:
        for number in range(3000):
            lines.phase(in_phase(Phase.SETTLING, f"alert {number} {'.' * 60}"))
            logging.getLogger("perchhw").error("an error")
        told.set()

    try:
        with Lines() as lines:
            threading.Thread(target=tell, args=(lines,), daemon=True).start()
            assert told.wait(60.0)
            drain = threading.Thread(target=read_all, args=(reader,), daemon=True)
            drain.start()
            writer_thread = next(one for one in threading.enumerate() if one.name == "lines")
        writer_thread.join(60.0)  # a command gives up sooner; the pipe is closed when nobody writes to it
        assert not writer_thread.is_alive()
    finally:
        logging.getLogger().removeHandler(handler)
        full.close()
    drain.join(60.0)
    assert not drain.is_alive()


def test_nobody_is_asked_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with Lines() as lines:
        with pytest.raises(NobodyToAsk, match=r"there is no terminal: .* add --yes") as refused:
            confirmation(False, lines)
        assert "attempt" not in str(refused.value)  # a hover is none
        confirmation(True, lines)("Put it back")
    assert read(capsys) == ["not asked (--yes): Put it back."]
