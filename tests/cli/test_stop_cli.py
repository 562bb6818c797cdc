"""``perchhw stop``: all drones that are named, in parallel, beside whoever is connected."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from onboard.link.errors import DroneStopped
from onboard.link.stop_note import StopsSince, note_stop
from perchhw.cli import stop
from perchhw.cli.main import run
from perchhw.cli.stop import drones_to_stop
from tests.link.clients import connected_elsewhere
from tests.link.tiny_drone import TinyDrone
from tests.patience import patient_link, until

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
        uris = silent.uri, good.uri
    said = capsys.readouterr()
    results = json.loads(said.out)["drones"]
    assert f"{uris[0]}: still stopping, not confirmed yet" in said.err
    assert f"{uris[1]}: still" not in said.err
    assert [result["locked"] for result in results] == [False, True]
    assert "said nothing" in results[0]["reason"]


def test_nothing_to_stop_is_wrong_usage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["stop"]) == 2
    assert "--drone" in capsys.readouterr().err


def test_who_is_in_a_hurry_leaves_the_option_out() -> None:
    with TinyDrone() as one, TinyDrone() as other:
        assert run(["stop", one.uri, "--drone", other.uri]) == 0
        assert one.supervisor_bits & other.supervisor_bits & LOCKED


def test_who_names_no_drone_is_told_how_to_stop_those_that_are_in_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In another folder than the lab file's, beside a flight whose address has a question mark in it."""
    monkeypatch.chdir(tmp_path)
    with TinyDrone() as flown:
        with connected_elsewhere(flown.uri):
            assert run(["stop", "--json"]) == 2
            told = json.loads(capsys.readouterr().out)["error"]
            assert f"perchhw stop --drone '{flown.uri}?" in told
        assert run(["stop"]) == 2  # that process was killed, and holds nothing
        assert flown.uri not in capsys.readouterr().err


def test_an_address_that_cannot_be_used_does_not_keep_the_other(capsys: pytest.CaptureFixture[str]) -> None:
    with TinyDrone() as good:
        assert run(["stop", "--drone", "udp//oops", "--drone", good.uri, "--json"]) == 2
        assert good.supervisor_bits & LOCKED
    assert [result["locked"] for result in json.loads(capsys.readouterr().out)["drones"]] == [False, True]


def started(
    *arguments: str, stdout: int = subprocess.PIPE, stderr: int = subprocess.PIPE
) -> "subprocess.Popen[str]":
    """``perchhw stop`` as a process of its own."""
    command = [sys.executable, "-m", "perchhw", "stop", *arguments]
    return subprocess.Popen(command, stdout=stdout, stderr=stderr, text=True)


def stops(tiny: TinyDrone) -> int:
    """How many stop packets came."""
    return sum(request[0] & 0xF3 == 0x91 and request[1:2] == b"\x03" for request in tiny.requests)


SIGNALS = (
    signal.SIGINT,
    signal.SIGTERM,
    signal.SIGHUP,
    signal.SIGQUIT,
    signal.SIGTSTP,
    signal.SIGUSR1,
    signal.SIGUSR2,
    signal.SIGINT,
)


def test_a_stop_that_is_interrupted_goes_on_and_says_what_came_of_it() -> None:
    with TinyDrone() as tiny:
        tiny.drop = lambda request: request[0] & 0xF3 in (0x90, 0x91)
        process = started("--drone", tiny.uri)
        until(lambda: stops(tiny))
        for number in SIGNALS:
            process.send_signal(number)
        before = stops(tiny)
        until(lambda: stops(tiny) > before + 3)
        tiny.drop = lambda _request: False
        output, errors = process.communicate()
        assert tiny.supervisor_bits & LOCKED
    assert process.returncode == 0, errors
    assert "locked after" in output
    assert "still stopping" in errors


def test_an_interrupted_stop_that_is_not_confirmed_says_so() -> None:
    with TinyDrone() as tiny:
        tiny.frozen.set()
        process = started("--drone", tiny.uri, "--json")
        until(lambda: stops(tiny))
        for number in SIGNALS:
            process.send_signal(number)
        output, errors = process.communicate()
    assert process.returncode == 1, errors
    (result,) = json.loads(output)["drones"]
    assert not result["locked"]
    assert "said nothing" in result["reason"]


@pytest.mark.parametrize("writes", [True, False], ids=["slow disk", "no disk"])
def test_a_stop_waits_for_its_note_and_says_when_there_is_none(
    writes: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def note_slowly(uri: str) -> bool:
        time.sleep(0.3)  # the drone is locked long before
        return writes and note_stop(uri)

    monkeypatch.setattr(stop, "note_stop", note_slowly)
    with TinyDrone() as tiny:
        since = StopsSince(tiny.uri)
        assert run(["stop", "--drone", tiny.uri, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["drones"][0]["noted"] is writes
        if writes:
            with pytest.raises(DroneStopped):
                since.check()
        else:
            assert run(["stop", "--drone", tiny.uri]) == 0
            assert "may take off again" in capsys.readouterr().out


@pytest.mark.parametrize("as_json", [(), ("--json",)], ids=["words", "json"])
def test_the_verdict_goes_to_stderr_where_nobody_reads_stdout(as_json: tuple[str, ...]) -> None:
    read, write = os.pipe()
    os.close(read)
    with TinyDrone() as tiny:
        process = started("--drone", tiny.uri, *as_json, stdout=write)
        os.close(write)
        _, errors = process.communicate()
        assert tiny.supervisor_bits & LOCKED
    assert process.returncode == 0, errors
    assert "locked after" in errors


@pytest.mark.parametrize(
    ("streams", "answers", "code"),
    [
        (">&-", True, 0),
        ("2>&-", True, 0),
        (">&- 2>&-", True, 0),
        (">/dev/full 2>/dev/full", True, 0),
        (">/dev/full 2>/dev/full", False, 1),
    ],
)
def test_the_exit_code_is_true_also_where_nobody_can_be_told(streams: str, answers: bool, code: int) -> None:
    line = f'exec "$0" -m perchhw stop --drone "$1" {streams}'
    with TinyDrone() as tiny:
        if not answers:
            tiny.frozen.set()
        ended = subprocess.run(["sh", "-c", line, sys.executable, tiny.uri], check=False)
        assert ended.returncode == code


def test_a_stop_asks_for_no_lock(capsys: pytest.CaptureFixture[str]) -> None:
    with TinyDrone() as tiny, connected_elsewhere(tiny.uri):
        assert run(["stop", "--drone", tiny.uri]) == 0
        assert tiny.supervisor_bits & LOCKED
    assert "locked after" in capsys.readouterr().out


def in_ruins(how: str, uri: str) -> bytes:
    """A lab file with one drone that is there, and one that somebody has taken out."""
    content = f"""schema = "perchhw.lab/1"
[mocap]
uri = "vicon-udp://:51001"
[[drones]]
uri = "{uri}"
vehicle = "crazyflie21-upgraded"
  # uri = "udp://127.0.0.1:9"
"""
    match how:
        case "syntax":
            return content.replace("[[drones]]", "[[drones]").encode()
        case "open quote":
            return content.replace(f'"{uri}"', f'"{uri}').encode()
        case "latin-1":
            return content.replace("crazyflie21-upgraded", "Krähe").encode("latin-1")
        case "utf-16":
            return content.encode("utf-16")
        case "one table":
            return content.replace("[[drones]]", "[drones]").encode()
        case "misspelt":
            return content.replace(f'uri = "{uri}"', f'url = "{uri}"').encode()
    raise ValueError(how)


@pytest.mark.parametrize("how", ["syntax", "open quote", "latin-1", "utf-16", "one table", "misspelt"])
def test_a_lab_file_in_ruins_keeps_no_drone_flying(
    how: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "lab.toml"
    with TinyDrone() as tiny:
        file.write_bytes(in_ruins(how, tiny.uri))
        assert run(["stop", "--lab", str(file), "--json"]) == 1  # nobody knows which drones it has lost
        assert tiny.supervisor_bits & LOCKED
        told = capsys.readouterr()
        document = json.loads(told.out)
        assert [result["drone"] for result in document["drones"]] == [tiny.uri]
        assert "looks like a drone's address" in document["doubt"]
    assert str(file) in told.err
    assert "looks like a drone's address" in told.err


def test_a_lab_file_that_names_no_drone_at_all_is_wrong_usage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "lab.toml").write_text("drones = \n")
    assert run(["stop", "--lab", str(tmp_path / "lab.toml")]) == 2
    assert "no address of a drone" in capsys.readouterr().err


def test_the_drone_of_the_environment_is_stopped_beside_those_of_the_lab_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with TinyDrone() as usual, TinyDrone() as other:
        monkeypatch.setenv("PERCHHW_DRONE", usual.uri)
        assert drones_to_stop((), None) == ([usual.uri], "")
        Path("lab.toml").write_text(f'[[drones]]\nuri = "{other.uri}"\n')
        assert run(["stop"]) == 0
        assert usual.supervisor_bits & other.supervisor_bits & LOCKED


def test_the_drone_of_the_environment_is_stopped_where_the_lab_file_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with TinyDrone() as usual:
        monkeypatch.setenv("PERCHHW_DRONE", usual.uri)
        monkeypatch.setenv("PERCHHW_LAB", str(tmp_path / "gone.toml"))
        assert run(["--json", "stop"]) == 1
        assert usual.supervisor_bits & LOCKED
    told = capsys.readouterr()
    document = json.loads(told.out)
    assert document["drones"][0]["locked"]
    assert "gone.toml: cannot be read" in document["doubt"]
    assert "PERCHHW_DRONE alone" in told.err
