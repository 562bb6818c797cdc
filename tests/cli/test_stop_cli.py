"""``perchhw stop``: all drones that are named, in parallel, beside whoever is connected."""

import json
from pathlib import Path

import pytest

from perchhw.cli.main import run
from tests.link.tiny_drone import TinyDrone
from tests.patience import patient_link

LOCKED = 0x40


def test_a_drone_is_stopped_beside_its_flight(capsys: pytest.CaptureFixture[str]) -> None:
    with TinyDrone() as tiny, patient_link(tiny.uri) as link:
        assert run(["stop", "--drone", tiny.uri, "--json"]) == 0
        assert tiny.supervisor_bits & LOCKED
        assert link.supervisor_info().is_locked
        (result,) = json.loads(capsys.readouterr().out)["drones"]
        assert result["locked"] is True
        assert result["drone"] == tiny.uri


def test_every_drone_of_the_lab_file_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with TinyDrone() as first, TinyDrone() as second:
        rows = "".join(f'[[drones]]\nuri = "{drone.uri}"\n' for drone in (first, second))
        (tmp_path / "elsewhere.toml").write_text(rows)
        assert run(["stop", "--lab", str(tmp_path / "elsewhere.toml")]) == 0
        assert first.supervisor_bits & second.supervisor_bits & LOCKED
        first.supervisor_bits = 1
        (tmp_path / "lab.toml").write_text(f'[[drones]]\nuri = "{first.uri}"\n')
        monkeypatch.chdir(tmp_path)
        assert run(["stop"]) == 0
        assert first.supervisor_bits & LOCKED
    assert capsys.readouterr().out.count("locked after") == 3


def test_one_drone_that_is_not_confirmed_does_not_keep_the_other(capsys: pytest.CaptureFixture[str]) -> None:
    with TinyDrone() as good, TinyDrone() as silent:
        silent.frozen.set()
        assert run(["stop", "--drone", silent.uri, "--drone", good.uri, "--json"]) == 1
        assert good.supervisor_bits & LOCKED
    results = json.loads(capsys.readouterr().out)["drones"]
    assert [result["locked"] for result in results] == [False, True]
    assert "said nothing" in results[0]["reason"]


def test_nothing_to_stop_is_wrong_usage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["stop"]) == 2
    assert "--drone" in capsys.readouterr().err


def test_an_address_that_cannot_be_used_does_not_keep_the_other(capsys: pytest.CaptureFixture[str]) -> None:
    with TinyDrone() as good:
        assert run(["stop", "--drone", "udp//oops", "--drone", good.uri, "--json"]) == 2
        assert good.supervisor_bits & LOCKED
    assert [result["locked"] for result in json.loads(capsys.readouterr().out)["drones"]] == [False, True]
