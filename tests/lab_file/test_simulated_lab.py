"""The simulated lab writes its own lab file, and a flight needs nothing else."""

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from onboard.lab_file import write_lab_file
from onboard.room import RoomGeometry
from perchhw.cli.main import run
from perchhw.lab import read_lab
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, LabNotReady, SimulatedLab
from perchhw.record import read_run

LAB = (*FREE_PORTS, *LOCKSTEP, "--seed", "7")


@pytest.fixture(scope="module")
def lab() -> Iterator[SimulatedLab]:
    with SimulatedLab("lab", (*LAB, "--drones", "2")) as lab:
        yield lab


def fly(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict[str, object]]:
    code = run(["--json", "fly", "--speed", "2.5", "--angle", "55", *arguments])
    return code, json.loads(capsys.readouterr().out)


def test_the_ready_line_names_the_file_of_this_room(lab: SimulatedLab) -> None:
    written = read_lab(Path(lab.ready["lab"]))
    assert written.room.geometry() == RoomGeometry()
    assert [drone.uri for drone in written.drones] == lab.drones
    assert [written.mocap_uri(drone) for drone in written.drones] == lab.mocap[:2]
    assert written.start(written.drones[1]).pose == (-2.5, 0.5, 0.0)
    assert written.mocap.latency_s.value == 0.004


def test_a_flight_needs_only_the_lab_file(
    lab: SimulatedLab, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, document = fly(
        capsys, "--lab", lab.ready["lab"], "--drone", lab.drones[1], "--dry-run", "--out", str(tmp_path)
    )
    assert code == 0, document
    config = read_run(Path(str(document["record"]))).info["config"]
    assert config["lab"] == lab.ready["lab"]
    assert config["mocap"] == lab.mocap[1]
    assert config["pose_correction"]["latency"] == 0.004
    assert config["room"]["x_min"] == RoomGeometry().x_min


@pytest.mark.further
def test_the_transform_and_the_limits_of_the_file_are_flown_with(
    lab: SimulatedLab, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """So far above its marker body the drone would stand in the air: it is not armed."""
    other = tmp_path / "other.toml"
    text = (
        Path(lab.ready["lab"])
        .read_text()
        .replace("position = [0.0, 0.0, 0.0]", "position = [0.0, 0.0, 0.15]")
    )
    other.write_text(text + "\n[limits]\nheight_on_ground = 0.12\n")
    code, document = fly(
        capsys, "--lab", str(other), "--drone", lab.drones[0], "--dry-run", "--out", str(tmp_path)
    )
    assert code == 3, document
    record = read_run(Path(str(document["record"])))
    assert 0.15 < float(np.nanmin(record.series["pose"].numbers("z"))) < 0.25
    assert record.info["config"]["limits"] == {"height_on_ground": 0.12}


def test_a_drone_that_is_not_on_its_mark_is_not_armed(
    lab: SimulatedLab, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lab_file = read_lab(Path(lab.ready["lab"]))
    first, second = lab_file.drones
    from dataclasses import replace

    other = tmp_path / "other.toml"
    write_lab_file(other, replace(lab_file, drones=(replace(first, start=second.start), second)))
    code, document = fly(
        capsys, "--lab", str(other), "--drone", lab.drones[0], "--dry-run", "--out", str(tmp_path)
    )
    assert code == 3
    assert str(document["aborted_by"]).startswith("start_mark_distance: 0.5 m")


def test_the_file_lives_as_long_as_the_lab(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    chosen = tmp_path / "lab.toml"
    with SimulatedLab("lab", (*LAB, "--lab", str(chosen))) as lab:
        assert lab.ready["lab"] == str(chosen)
        with pytest.raises(LabNotReady, match=r"lab\.toml: exists and is not overwritten; remove it or"):
            SimulatedLab("lab", (*LAB, "--lab", str(chosen))).open()
        assert chosen.exists()
        code, document = fly(capsys, "--lab", str(chosen), "--dry-run", "--out", str(tmp_path / "runs"))
        assert code == 0, document
    assert not chosen.exists()


def test_what_a_killed_lab_left_goes_when_the_next_one_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with SimulatedLab("lab", LAB) as killed:
        left = killed.lab_file
        assert left.is_relative_to(tmp_path)
        os.kill(killed.pid, signal.SIGKILL)
    assert left.exists()
    with SimulatedLab("lab", LAB) as lab:
        assert list(tmp_path.rglob("lab.toml")) == [lab.lab_file]
    assert not list(tmp_path.iterdir())
