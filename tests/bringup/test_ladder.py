"""``perchhw bringup`` at the simulated lab: the whole ladder, and the faults that it must catch."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from typing import Any

import pytest

from onboard.outcome import Outcome
from perchhw.bringup.passes import STEPS, Passes, passes_file
from perchhw.cli.main import run
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from perchhw.record import read_run

PHRASE = "propellers off, drone hung or held"
PHRASE_OF_A_BENCH = "props guarded, drone clamped"


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)


class Ladder:
    """The command at one lab and its drone, by the URI `drone`."""

    def __init__(self, lab: SimulatedLab, drone: str, capsys: pytest.CaptureFixture[str]) -> None:
        self.lab, self._drone, self._capsys = lab, drone, capsys

    def __call__(self, step: str | None = None, *arguments: str) -> tuple[int, Any]:
        self._capsys.readouterr()
        which = [] if step is None else ["--step", step]
        code = run(["--json", "bringup", *which, *arguments, *self.where, "--yes"])
        return code, json.loads(self._capsys.readouterr().out)

    @property
    def where(self) -> tuple[str, ...]:
        return "--drone", self._drone, "--mocap", self.lab.mocap[0]

    def has_passed(self, *steps: str) -> None:
        """Note passes that another test climbs for."""
        _, shown = self()
        kept = Passes(
            self._drone,
            int(shown["vehicle_crc32"], 16),
            date.fromisoformat(shown["day"]),
            passes_file(),
        )
        for step in steps:
            kept.add(step)


@contextmanager
def ladder(capsys: pytest.CaptureFixture[str], *arguments: str) -> Iterator[Ladder]:
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, *arguments)) as lab:
        yield Ladder(lab, lab.drones[0], capsys)


@contextmanager
def patient_ladder(capsys: pytest.CaptureFixture[str], *arguments: str) -> Iterator[Ladder]:
    """Motors of a bench are watched on the wall clock: over a link that bears a busy machine."""
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, *arguments)) as lab:
        drone = lab.drones[0]
        yield Ladder(lab, f"{drone}{'&' if '?' in drone else '?'}silence_s=15", capsys)


def missing(document: Any) -> list[str]:
    return [one["what"] for one in document["findings"] if one["verdict"] not in ("fine", "note")]


@pytest.mark.soak
def test_the_ladder_leads_to_a_landing_that_is_judged_by_its_label(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with ladder(capsys, "--fault", "held_at=6:4") as climb:
        assert climb("landing")[0] == 3
        climb.has_passed("motors")
        for number, step in enumerate(STEPS[1:-1], 1):
            assert climb()[1]["next"] == step
            code, document = climb(step)
            assert (code, document["pass"], missing(document)) == (0, True, []), document
            assert climb()[1]["passed"] == list(STEPS[: number + 1])
        code, document = climb("landing")
        outcome = read_run(next(Path("runs").glob("*fly-2.5ms*"))).info["outcome"]
        attached = Outcome(outcome).attached  # not every landing of the simulated lab holds
        assert (code, missing(document)) == ((0, []) if attached else (1, ["landed"]))
        assert climb()[1]["next"] == (None if attached else "landing")


@pytest.mark.further
def test_a_subject_that_is_turned_fails_the_tilt_though_the_doctor_cannot_see_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with ladder(capsys, "--fault", "held_at=6:4") as climb:
        text = Path(climb.lab.ready["lab"]).read_text(encoding="utf-8")
        level = "quaternion = [0.0, 0.0, 0.0, 1.0]"
        assert level in text
        turned = tmp_path / "turned.toml"
        turned.write_text(
            text.replace(level, "quaternion = [0.0, 0.0, 0.7071068, 0.7071068]"), encoding="utf-8"
        )
        climb.has_passed("motors")
        code, document = climb("tilt", "--lab", str(turned))
        assert (code, missing(document)) == (1, ["nose_down", "left_side_down"])
        assert climb("hover")[0] == 3


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param("motors_swapped=1,3", marks=pytest.mark.further),
        pytest.param("propeller_reversed=2", marks=pytest.mark.soak),
    ],
)
def test_a_drone_that_is_put_together_wrongly_fails_the_hover(
    fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with ladder(capsys, "--fault", fault) as climb:
        climb.has_passed("motors", "tilt")
        code, document = climb("hover")
        assert (code, missing(document)) == (1, ["flight"])
        assert climb()[1]["passed"] == ["motors", "tilt"]
        assert climb("step")[0] == 3


@pytest.mark.soak
def test_motors_turn_one_by_one_and_what_was_seen_is_judged(capsys: pytest.CaptureFixture[str]) -> None:
    with patient_ladder(capsys) as climb:
        code, document = climb("motors", "--confirm", PHRASE_OF_A_BENCH, "--saw", "1 ccw")
        assert code == 3
        assert f"the motors stay locked: type {PHRASE!r}" in document["error"]
        right = "1 ccw,2 cw,3 ccw,4 cw"
        code, document = climb("motors", "--confirm", PHRASE, "--saw", right)
        assert (code, missing(document), climb()[1]["passed"]) == (0, [], ["motors"])
        code, document = climb("motors", "--confirm", PHRASE, "--saw", "2 ccw,1 cw,3 cw")
        wrong = ["motor_1", "motor_2", "motor_3", "motor_4"]
        assert (code, missing(document), climb()[1]["passed"]) == (1, wrong, [])


@pytest.mark.soak
@pytest.mark.parametrize(
    ("fault", "wrong"),
    [
        ((), []),
        (("--fault", "motors_swapped=1,2"), ["motor_1", "motor_2"]),
        (("--fault", "motor_reversed=4"), ["motor_4"]),
    ],
)
def test_on_a_thread_the_gyro_tells_what_the_operator_does_not_see(
    fault: tuple[str, ...], wrong: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """Who believes to see what should be passes nothing that turns the wrong way."""
    with patient_ladder(capsys, "--fault", "hung_at=0", *fault) as climb:
        code, document = climb("motors", "--confirm", PHRASE, "--saw", "1,2,3,4")
        assert (code, missing(document)) == (1 if wrong else 0, wrong), document
        assert climb()[1]["passed"] == ([] if wrong else ["motors"])


def test_a_step_that_does_not_exist_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["bringup", "--step", "flip"]) == 2
    assert "motors, tilt, hover" in capsys.readouterr().err
