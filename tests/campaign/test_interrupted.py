"""A campaign that is ended where nothing flies says how it goes on."""

import errno
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from perchhw.campaign import load_plan, run_campaign
from perchhw.cli.main import run
from perchhw.record import RunRecorder
from tests.campaign.stand_in import fly
from tests.patience import PATIENCE_S

GRID = "[grid]\nspeeds = [2.25]\nangles_deg = [52.5]\n"
FLIGHTS = '[[flight]]\nkind = "thrust_steps"\n'


@pytest.mark.parametrize(
    ("content", "number"),
    [
        pytest.param(GRID, signal.SIGTERM, id="grid-term"),
        pytest.param(FLIGHTS, signal.SIGINT, id="flights-int"),
        pytest.param(GRID, signal.SIGINT, id="grid-int", marks=pytest.mark.further),
        pytest.param(FLIGHTS, signal.SIGTERM, id="flights-term", marks=pytest.mark.further),
    ],
)
def test_a_campaign_that_is_ended_before_a_flight_says_how_to_go_on(
    content: str, number: signal.Signals, tmp_path: Path
) -> None:
    """Without a terminal, while it waits for what its drone says of itself."""
    file, folder = tmp_path / "two.toml", tmp_path / "campaign"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone:
        drone.bind(("127.0.0.1", 0))
        drone.settimeout(PATIENCE_S)
        where = f'drone = "udp://127.0.0.1:{drone.getsockname()[1]}?connect_s={PATIENCE_S}"'
        head = f'schema = "perchhw.campaign/1"\n{where}\nmocap = "vicon://127.0.0.1:1?subject=cf1"\n'
        file.write_text(head + content)
        running = subprocess.Popen(
            [sys.executable, "-m", "perchhw", "campaign", "run", str(file), "--yes", "--out", str(folder)],
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            drone.recv(64)
            running.send_signal(number)
            errors = running.communicate()[1]
        finally:
            running.kill()
    assert running.returncode == 130, errors
    assert "continue with --resume" in errors
    assert str(folder) in errors.replace("\n", "")


@pytest.mark.usefixtures("own_drone_files")
def test_a_campaign_that_is_ended_while_its_pages_are_drawn_says_so_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """All is flown: the same command draws what is left."""

    def flown(*_: object, **__: object) -> list[object]:
        return []

    def interrupted(_folder: Path, **_: object) -> Path:
        raise KeyboardInterrupt

    monkeypatch.setattr("perchhw.cli.displayed_campaign.run_displayed", flown)
    monkeypatch.setattr("perchhw.report.campaign_report.write_campaign_report", interrupted)
    file = tmp_path / "one.toml"
    where = 'drone = "udp://127.0.0.1:1"\nmocap = "vicon://127.0.0.1:1?subject=cf1"\n'
    file.write_text(f'schema = "perchhw.campaign/1"\n{where}{GRID}')
    assert run(["campaign", "run", str(file), "--yes", "--out", str(tmp_path / "campaign")]) == 130
    assert "continue with --resume" in capsys.readouterr().err


@pytest.mark.usefixtures("own_drone_files")
def test_who_interrupts_a_flight_is_told_what_came_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "campaign"

    def flown(name: str) -> None:
        with RunRecorder(folder / "attempts" / name, {}) as recorder:
            told = {"code": "operator", "sentence": f"{name} was cut", "next": "look it over", "values": {}}
            recorder.close(outcome="aborted", diagnosis=told)

    def interrupted(*_: object, **__: object) -> None:
        flown("20261125T2-second")
        raise KeyboardInterrupt

    flown("20261125T1-first")
    monkeypatch.setattr("perchhw.cli.displayed_campaign.run_displayed", interrupted)
    file = tmp_path / "one.toml"
    where = 'drone = "udp://127.0.0.1:1"\nmocap = "vicon://127.0.0.1:1?subject=cf1"\n'
    file.write_text(f'schema = "perchhw.campaign/1"\n{where}{GRID}')
    assert run(["campaign", "run", str(file), "--yes", "--out", str(folder)]) == 130
    said = capsys.readouterr().err
    assert "20261125T2-second was cut\nnext: look it over\ncontinue with --resume" in said
    assert said.endswith("interrupted\n")
    assert "first" not in said


@pytest.mark.usefixtures("own_drone_files")
def test_a_full_disk_costs_a_campaign_its_page_and_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file, folder = tmp_path / "one.toml", tmp_path / "campaign"
    where = 'drone = "udp://127.0.0.1:1"\nmocap = "vicon://127.0.0.1:1?subject=cf1"\n'
    file.write_text(f'schema = "perchhw.campaign/1"\n{where}{GRID}')
    flown = run_campaign(load_plan(file), folder, fly)

    def full(_stream: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("perchhw.cli.displayed_campaign.run_displayed", lambda *_, **__: flown)
    monkeypatch.setattr("onboard.atomic_file.os.fsync", full)
    assert run(["--json", "campaign", "run", str(file), "--yes", "--resume", "--out", str(folder)]) == 0
    said = capsys.readouterr()
    told = json.loads(said.out)
    assert (told["report"], len(told["attempts"])) == (None, len(flown))
    assert f"no report: {folder}" in said.err
    assert "No space left on device" in said.err
    assert run(["campaign", "report", str(folder)]) == 2
