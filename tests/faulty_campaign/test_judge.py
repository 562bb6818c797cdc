"""The judge of the faulty campaigns finds what it is there for, and draws the same shift again."""

import itertools
import json
from pathlib import Path
from typing import Any

import pytest

from perchhw.attempt import Outcome
from perchhw.campaign.store import AttemptRow
from perchhw.record import RunRecorder
from sim_backend.truth import COLUMNS, MOTOR_COLUMN
from tests.faulty_campaign.judge import ERROR, LABEL, LOST, MOTORS, REASON, TWICE, Judged, counted, judge
from tests.faulty_campaign.shift import Blow, draw_shift

NAME = "20260101T000000Z-000-try1"
BEGIN, OFF, END = 1.0, 4.0, 5.0


def row(folder: Path, **changes: Any) -> AttemptRow:
    values: dict[str, Any] = {
        "id": 1,
        "slot": 0,
        "try_number": 1,
        "state": "done",
        "outcome": Outcome.FOUR_LEG,
        "triggered": True,
        "trigger": None,
        "aborted_by": None,
        "record": folder / "campaign" / "attempts" / NAME,
        "started_utc": None,
        "ended_utc": None,
        "speed": 2.5,
        "angle_deg": 50.0,
        "repeat": 1,
    }
    return AttemptRow(**{**values, **changes})


class Scene:
    """One shift with one flight: it takes off after its begin, hangs on four feet, and has its motors off."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.row: dict[str, Any] = {}
        self.said: dict[str, Any] = {"struck": [], "causes": [], "faults": {}, "exit_code": 0}
        self.closing: dict[str, Any] = {"outcome": "four_leg"}
        self.phases = ("arming", "taking off")
        self.off = OFF

    def judged(self) -> Judged:
        """What is said of it."""
        shift = self.folder / "shifts" / "0000"
        shift.mkdir(parents=True)
        said = {"number": 0, "before": [], "records": [NAME], "hung": False, "file_limit": None, **self.said}
        (shift / "shift.json").write_text(json.dumps(said))
        (shift / "truth.csv").write_text(
            "\n".join([f"{COLUMNS},{MOTOR_COLUMN}", *map(self.truth, range(0, 700)), ""])
        )
        times = itertools.chain([BEGIN], itertools.repeat(END))
        with RunRecorder(self.folder / "campaign/attempts" / NAME, {}, lambda: next(times)) as recorder:
            for phase in self.phases:
                recorder.event("phase", BEGIN + 0.5, phase=phase)
            recorder.close(**self.closing)
        return judge(shift, self.folder / "campaign", [row(self.folder, **self.row)])

    def truth(self, sample: int) -> str:
        """A row of the world's record."""
        t = 0.01 * sample
        flies, hangs = t >= BEGIN + 0.6, t >= BEGIN + 2.0
        z, motors = (2.0 if hangs else 0.5) if flies else 0.05, 30_000 if BEGIN + 0.5 <= t < self.off else 0
        return f"{t:.2f},cf1,0,0,{z},0,0,0,1,0,0,0,0,0,0,{4 * hangs:d},0,{motors}"


def test_a_flight_with_nothing_wrong(tmp_path: Path) -> None:
    judged = Scene(tmp_path).judged()
    assert judged == Judged(aborts=0, reasons=0, labels=1, flights=1, wrong=())


def wrongs(scene: Scene) -> list[str]:
    return [wrong.what for wrong in scene.judged().wrong]


def test_motors_that_turn_on_after_an_abort(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    scene.row = {"outcome": Outcome.ABORTED, "aborted_by": "pose: lost"}
    scene.closing = {"outcome": "aborted", "diagnosis": {"code": "mocap_silent", "sentence": "gone"}}
    scene.said["causes"], scene.off = ["mocap_silent"], END + 0.3
    assert wrongs(scene) == [MOTORS]


def test_a_reason_for_which_there_was_no_cause(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    scene.row = {"outcome": Outcome.ABORTED, "aborted_by": "link_lost: gone"}
    scene.closing = {"outcome": "aborted", "diagnosis": {"code": "link_lost", "sentence": "gone"}}
    scene.said["causes"] = ["mocap_silent"]
    assert wrongs(scene) == [REASON]


def test_a_flight_in_a_lab_that_fell_behind_real_time_is_not_judged(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    scene.row = {"outcome": Outcome.ABORTED, "aborted_by": "tilt_in_hover: 39.4 deg"}
    scene.closing = {
        "outcome": "aborted",
        "drone_clock_rate": 0.88,
        "diagnosis": {"code": "tumbled", "sentence": "this computer was too busy"},
    }
    scene.off = END + 0.3
    scene.said["at_real_pace"] = True
    judged = scene.judged()
    assert (judged.wrong, judged.late, judged.reasons) == ((), 1, 0)


def test_in_lock_step_a_slow_clock_excuses_nothing(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    scene.closing["drone_clock_rate"] = 0.88
    scene.off = END + 0.3
    assert wrongs(scene) == [MOTORS]


def test_a_lab_that_dies_before_a_flight_has_its_drone_is_cause_enough(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    scene.row = {"outcome": Outcome.ABORTED, "aborted_by": "no drone at udp://127.0.0.1:1"}
    scene.closing = {"outcome": "aborted", "diagnosis": {"code": "not_begun", "sentence": "no drone"}}
    scene.said["struck"] = [{"blow": Blow.LAB_KILLED, "record": NAME, "phase": "done", "left": ""}]
    assert REASON not in wrongs(scene)


def test_a_label_that_the_world_does_not_bear_out(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    scene.row = {"outcome": Outcome.TWO_LEG}
    assert wrongs(scene) == [LABEL]


def test_a_flight_that_no_record_tells_of(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    scene.phases = ("checking",)
    assert wrongs(scene) == [LOST]


def test_events_that_a_kill_has_cost(tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    scene.row = {"state": "interrupted", "outcome": None}
    scene.closing = {"diagnosis": {"code": "process_killed", "sentence": "killed"}}
    left = '{"event": "something that was written before"}\n'
    scene.said["struck"] = [{"blow": Blow.KILLED, "record": NAME, "phase": None, "left": left}]
    assert wrongs(scene) == [LOST]


@pytest.mark.parametrize("ended", [{"exit_code": 1}, {"exit_code": -9}, {"hung": True, "exit_code": -9}])
def test_a_run_that_ends_as_none_may(ended: dict[str, Any], tmp_path: Path) -> None:
    scene = Scene(tmp_path)
    scene.said |= ended
    assert wrongs(scene) == [ERROR]


def test_what_is_lost_or_counted_twice_in_the_campaign(tmp_path: Path) -> None:
    attempts = tmp_path / "campaign" / "attempts"
    (attempts / NAME).mkdir(parents=True)
    assert counted([row(tmp_path)], tmp_path / "campaign", 1) == []
    (attempts / "orphan").mkdir()
    rows = [
        row(tmp_path),
        row(tmp_path, id=2, try_number=2),
        row(tmp_path, id=3, slot=1, record=tmp_path / "no"),
    ]
    found = [(wrong.what, wrong.record) for wrong in counted(rows, tmp_path / "campaign", 3)]
    assert sorted(found) == sorted(
        [(TWICE, "slot 0"), (LOST, "slot 2"), (TWICE, NAME), (LOST, "no"), (LOST, "orphan")]
    )


def test_a_shift_is_drawn_again_by_its_number_and_all_blows_are_struck() -> None:
    shifts = [draw_shift((1, 0), number, 25) for number in range(200)]
    assert shifts[7] == draw_shift((1, 0), 7, 25)
    assert {strike.blow for shift in shifts for strike in shift.strikes} == set(Blow)
    assert any(shift.file_limit for shift in shifts)
    assert any(shift.at_real_pace for shift in shifts)
    assert len({name for shift in shifts for name in shift.faults}) == 13
