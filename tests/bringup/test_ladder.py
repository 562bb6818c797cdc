"""``perchhw bringup`` at the simulated lab: the whole ladder, and the faults that it must catch."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from perchhw.bringup.passes import STEPS, Passes, passes_file
from perchhw.cli.main import run
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab

PHRASE = "props guarded, drone clamped"


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.chdir(tmp_path)


class Ladder:
    """The command at one lab."""

    def __init__(self, lab: SimulatedLab, capsys: pytest.CaptureFixture[str]) -> None:
        self.lab, self._capsys = lab, capsys

    def __call__(self, *arguments: str) -> tuple[int, Any]:
        self._capsys.readouterr()
        code = run(["--json", "bringup", *arguments, *self.where, "--yes"])
        return code, json.loads(self._capsys.readouterr().out)

    @property
    def where(self) -> tuple[str, ...]:
        return "--drone", self.lab.drones[0], "--mocap", self.lab.mocap[0]

    def has_passed(self, *steps: str) -> None:
        """Note passes that another test climbs for."""
        _, shown = self()
        from datetime import date

        kept = Passes(
            self.lab.drones[0],
            int(shown["vehicle_crc32"], 16),
            date.fromisoformat(shown["day"]),
            passes_file(),
        )
        for step in steps:
            kept.add(step)


@contextmanager
def ladder(capsys: pytest.CaptureFixture[str], *arguments: str) -> Iterator[Ladder]:
    with SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, *arguments)) as lab:
        yield Ladder(lab, capsys)


def missing(document: Any) -> list[str]:
    return [one["what"] for one in document["findings"] if one["verdict"] not in ("fine", "note")]


@pytest.mark.timeout(300)
def test_the_ladder_leads_to_a_landing(capsys: pytest.CaptureFixture[str]) -> None:
    with ladder(capsys, "--fault", "held_at=8:30") as climb:
        assert climb("landing")[0] == 3
        climb.has_passed("motors")
        for number, step in enumerate(STEPS[1:], 1):
            assert climb()[1]["next"] == step
            code, document = climb(step)
            assert (code, document["pass"], missing(document)) == (0, True, []), document
            assert climb()[1]["passed"] == list(STEPS[: number + 1])
        assert climb()[1]["next"] is None
