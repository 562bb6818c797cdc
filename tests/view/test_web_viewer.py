"""The page of a view: on loopback only, fed with one run after another, and gone when the verb ends."""

import json
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest
from rerun.chunk import RrdReader

from perchhw.cli.main import run
from perchhw.view.viewer import program
from tests.patience import until
from tests.view.flown import record

LISTENING, LOOPBACK = "0A", "0100007F"
A_RECORD = 200_000
"""Bytes: most of a recording of :mod:`tests.view.flown`, which has 270,000; twice as much needs two."""


def listening_addresses(port: int) -> set[str]:
    """Local addresses, in hexadecimal as the kernel prints them, on which somebody listens at `port`."""
    lines = [
        line.split()
        for name in ("tcp", "tcp6")
        for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]
    ]
    local = [(fields[1].rsplit(":", 1), fields[3]) for fields in lines]
    return {address for (address, number), state in local if state == LISTENING and int(number, 16) == port}


@pytest.mark.further
@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads the kernel's table of sockets")
def test_two_attempts_of_a_campaign_reach_another_client_over_loopback(tmp_path: Path) -> None:
    runs = [tmp_path / "attempts" / f"20260101T00000{i}Z-try" for i in range(2)]
    record(runs[0])
    saved = tmp_path / "saved.rrd"
    command = [sys.executable, "-m", "perchhw", "--json", "view", str(tmp_path), "--web", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as viewer:
        assert viewer.stdout is not None
        url = urlsplit(json.loads(viewer.stdout.readline())["url"])
        feed = parse_qs(url.query)["url"][0]
        ports = {port for port in (url.port, urlsplit(feed).port) if port is not None}
        client = subprocess.Popen(
            [program(), "--bind", "127.0.0.1", "--port", "auto", "--save", str(saved), feed],
            stderr=subprocess.DEVNULL,
        )
        try:
            assert [listening_addresses(port) for port in ports] == [{LOOPBACK}] * 2
            with urllib.request.urlopen(f"http://{url.netloc}/", timeout=60) as answer:
                assert answer.url == url.geturl()  # the bare address leads to the page with its feed
                assert b"rerun" in answer.read().lower()
                rules = dict(
                    rule.split(" ", 1) for rule in answer.headers["Content-Security-Policy"].split("; ")
                )
            assert (
                rules["default-src"] == "'none'"
            )  # the browser refuses what Rerun's page asks of the internet
            assert not any("http" in rule.replace("http://127.0.0.1:", "") for rule in rules.values())
            until(lambda: saved.exists() and saved.stat().st_size > A_RECORD)
            record(runs[1])
            until(lambda: saved.stat().st_size > 2 * A_RECORD)
        finally:
            viewer.send_signal(signal.SIGTERM)
            assert viewer.wait(timeout=120) == 130
            assert client.wait(timeout=120) == 0
    for closed in ports:
        with socket.socket() as probe:
            assert probe.connect_ex(("127.0.0.1", closed)) != 0
    reader = RrdReader(saved)
    assert {store.recording_id for store in reader.recordings()} == {run.name for run in runs}
    assert len(reader.blueprints()) == 2


@pytest.mark.parametrize("port", ["80000", "-1"])
def test_a_port_that_is_none_is_refused_in_words(
    port: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["view", str(tmp_path), "--web", "--port", port]) == 2
    assert "Invalid value for '--port'" in capsys.readouterr().err


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere no variable names a screen")
def test_a_window_without_a_screen_is_refused_before_it_opens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Rerun's viewer takes connections first, and fails then."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("perchhw.cli.view.os.nice", lambda _: 0)
    record(tmp_path / "run")
    assert run(["view", str(tmp_path / "run")]) != 0
    said = capsys.readouterr()
    assert "no screen" in said.err
    assert "--web" in said.err
    assert "opened" not in said.out
