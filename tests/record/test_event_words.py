"""What a record's events say to a person."""

from pathlib import Path

from onboard.record.recorder import RunRecorder
from perchhw.record import read_run
from perchhw.record.event_words import time_line
from perchhw.record.notes import add_note


def test_a_note_stands_where_its_key_was_pressed_in_words(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with RunRecorder(folder, {}, clock=lambda: 5.0) as recorder:
        recorder.event("phase", 6.0, phase="taking off")
        add_note(folder, 7.0, "", "taking off")
        recorder.event("phase", 8.0, phase="done")
        recorder.close(outcome="failure")
    add_note(folder, 7.0, "hops", "taking off")

    lines = time_line(read_run(folder))

    assert lines == [
        (1.0, "phase: taking off"),
        (2.0, "the operator's key: a moment to be noted"),
        (2.0, "the operator's note: hops"),
        (3.0, "phase: done"),
        (3.0, "outcome: failure"),
    ]
