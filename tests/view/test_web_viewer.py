"""The page of a view: served on loopback only, and gone when the verb ends."""

import json
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from tests.view.flown import record

LISTENING = "0A"


def listening_addresses(port: int) -> set[str]:
    """Local addresses, in hexadecimal as the kernel prints them, on which somebody listens at `port`."""
    lines = [line.split() for name in ("tcp", "tcp6") for line in _kernel_table(name)]
    local = [(fields[1].rsplit(":", 1), fields[3]) for fields in lines]
    return {address for (address, number), state in local if state == LISTENING and int(number, 16) == port}


def _kernel_table(name: str) -> list[str]:
    return Path(f"/proc/net/{name}").read_text().splitlines()[1:]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads the kernel's table of sockets")
def test_the_page_is_on_loopback_only_and_ends_with_the_verb(tmp_path: Path) -> None:
    record(tmp_path / "20260101T000000Z-run")
    command = [sys.executable, "-m", "perchhw", "--json", "view", str(tmp_path), "--web"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as viewer:
        assert viewer.stdout is not None
        said = json.loads(viewer.stdout.readline())
        try:
            assert said["run"] == str(tmp_path)
            page = said["url"].split("/?")[0]
            port = int(page.rsplit(":", 1)[1])
            with urllib.request.urlopen(page, timeout=60) as answer:
                assert b"rerun" in answer.read().lower()
            assert listening_addresses(port) == {"0100007F"}  # 127.0.0.1
            feed = int(said["url"].split("%3A")[-1].split("%2F")[0])
            assert listening_addresses(feed) == {"0100007F"}
        finally:
            viewer.send_signal(signal.SIGTERM)
        assert viewer.wait(timeout=120) == 130
    for closed in (port, feed):
        with socket.socket() as probe:
            assert probe.connect_ex(("127.0.0.1", closed)) != 0
