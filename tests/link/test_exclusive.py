"""One process at a time talks to a drone: real processes, a real drone's socket, the machine's own locks."""

import logging
from pathlib import Path

import pytest

from onboard.errors import InputError
from onboard.link import (
    DroneInUse,
    DroneIsFlying,
    DroneLink,
    LinkInputError,
    LinkTimeout,
    machine_files,
    reboot,
)
from onboard.link.exclusive import hold
from onboard.link.machine_files import drone_key
from onboard.link.stop_drone import stop_drone
from perchhw.cli.main import run
from tests.link.clients import connected_elsewhere, first_line, start_client
from tests.link.tiny_drone import TinyDrone
from tests.patience import patient_link

FLYING = 0x1B
POWER_HEADER = b"\xff"


def test_a_second_process_is_refused_before_its_first_packet(tiny: TinyDrone) -> None:
    assert issubclass(DroneInUse, InputError)
    with connected_elsewhere(tiny.uri) as client:
        before = set(tiny.clients)
        with pytest.raises(
            DroneInUse,
            match=rf"by process {client.pid} \(.*\) since 20[-0-9]+ [:0-9]+: .*perchhw stop --drone",
        ):
            DroneLink.open(tiny.uri.replace("127.0.0.1", "localhost") + "?silence_s=9")
        with pytest.raises(DroneInUse):
            reboot(tiny.uri)
        assert tiny.clients == before  # a link has a socket of its own: no packet came from another


ARMS_OR_WRITES = (
    ("fly", "--mocap", "vicon://127.0.0.1:9?subject=cf1", "--speed", "2.5", "--angle", "50"),
    ("policy", "upload", "default"),
    ("rehearse",),
    ("bringup", "--mocap", "vicon://127.0.0.1:9?subject=cf1", "--step", "motors", "--confirm", "x"),
)


def test_whatever_arms_or_writes_is_refused_while_another_process_has_the_drone(
    tiny: TinyDrone,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with connected_elsewhere(tiny.uri) as client:
        for verb in ARMS_OR_WRITES:
            code = run([*verb, "--drone", tiny.uri])
            said = capsys.readouterr().err
            assert (code, f"in use by process {client.pid}" in said) == (2, True), f"{verb[0]}: {said}"


def test_a_drone_that_is_given_back_is_free(tiny: TinyDrone) -> None:
    for _ in range(2):
        with connected_elsewhere(tiny.uri) as client:
            assert client.stdin is not None
            client.stdin.close()
            assert client.wait() == 0
        patient_link(tiny.uri).close()


def test_a_process_that_was_killed_holds_nothing(tiny: TinyDrone) -> None:
    with connected_elsewhere(tiny.uri) as client:
        client.kill()
        client.wait()
        patient_link(tiny.uri).close()


def test_links_of_one_process_are_counted(tiny: TinyDrone) -> None:
    with patient_link(tiny.uri):
        with patient_link(tiny.uri):
            pass
        with start_client(tiny.uri) as client:
            assert first_line(client).startswith("DroneInUse")
    with connected_elsewhere(tiny.uri):
        pass


def test_a_connection_that_fails_holds_nothing(tiny: TinyDrone) -> None:
    tiny.frozen.set()
    with pytest.raises(LinkTimeout):
        DroneLink.open(tiny.uri, timeout_s=0.2)
    tiny.frozen.clear()
    with connected_elsewhere(tiny.uri):
        pass


def test_a_stop_asks_for_no_lock(tiny: TinyDrone) -> None:
    with connected_elsewhere(tiny.uri):
        assert stop_drone(tiny.uri).locked
        assert tiny.supervisor_bits & 0x40


def test_releasing_twice_takes_nothing_from_others(tiny: TinyDrone) -> None:
    first, second = hold(tiny.uri), hold(tiny.uri)
    first.release()
    first.release()
    with start_client(tiny.uri) as client:
        assert first_line(client).startswith("DroneInUse")
    second.release()
    with connected_elsewhere(tiny.uri):
        pass


@pytest.mark.parametrize("drone", ["udp://127.0.0.1:9", "radio://0/80/2M/E7E7E7E7E7", "usb://0"])
def test_no_file_is_left_behind(drone: str, own_drone_files: Path) -> None:
    with hold(drone):
        assert len(list(own_drone_files.iterdir())) == 1
    assert not list(own_drone_files.iterdir())


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("udp://127.0.0.1:19850", "udp://localhost:19850?silence_s=3&x=y"),
        ("udp://LOCALHOST:19850", "udp://localhost:19850"),
        ("radio://0/80/2M/E7E7E7E7E7", "radio://1/80/2M/e7e7e7e7e7?rate_limit=100"),
        ("radio://0/80", "radio://0/080/2M/E7E7E7E7E7"),
        ("radio://0/80/2M/1", "radio://A1B2C3D4E5/80/2M/0000000001/"),
    ],
)
def test_two_addresses_of_one_drone_have_one_lock(one: str, other: str) -> None:
    assert drone_key(one) == drone_key(other)


def test_two_drones_have_two_locks() -> None:
    uris = (
        "udp://127.0.0.1:19850",
        "udp://127.0.0.1:19851",
        "udp://127.0.0.2:19850",
        "radio://0/80/2M/E7E7E7E7E7",
        "radio://0/80/1M/E7E7E7E7E7",
        "radio://0/81/2M/E7E7E7E7E7",
        "radio://0/80/2M/E7E7E7E7E8",
        "usb://0",
    )
    assert len({drone_key(uri) for uri in uris}) == len(uris)
    with pytest.raises(LinkInputError):
        hold("tcp://127.0.0.1:1")


@pytest.fixture
def no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the locks should be, none can be made."""
    (tmp_path / "file").touch()
    monkeypatch.setattr(machine_files, "FOLDER", tmp_path / "file" / "locks")


@pytest.mark.usefixtures("no_folder")
def test_where_no_lock_can_be_made_the_drone_flies_and_it_is_said(
    tiny: TinyDrone, caplog: pytest.LogCaptureFixture
) -> None:
    with patient_link(tiny.uri) as link:
        assert link.supervisor_info().can_arm
    (said,) = (r for r in caplog.records if r.levelno >= logging.ERROR)
    assert "cannot keep other processes off" in said.getMessage()


def test_a_drone_that_says_that_it_flies_is_not_rebooted(tiny: TinyDrone) -> None:
    tiny.supervisor_bits = FLYING
    with pytest.raises(DroneIsFlying, match=r"is flying.*perchhw stop --drone"):
        reboot(tiny.uri)
    assert not any(request[:1] == POWER_HEADER and request[1:2] == b"\xfe" for request in tiny.requests)
    reboot(tiny.uri, even_flying=True)
    assert any(request[:2] == POWER_HEADER + b"\xfe" for request in tiny.requests)


def test_a_drone_that_has_just_landed_is_rebooted(tiny: TinyDrone) -> None:
    tiny.supervisor_bits = FLYING

    def lands(request: bytes) -> bool:
        if request[0] & 0xF3 == 0x90 and tiny.count(0x90) > 2:
            tiny.supervisor_bits = 0x01
        return False

    tiny.drop = lands
    reboot(tiny.uri)
    assert any(request[:2] == POWER_HEADER + b"\xfe" for request in tiny.requests)


def test_a_firmware_that_says_nothing_is_rebooted(tiny: TinyDrone) -> None:
    tiny.drop = lambda request: request[0] & 0xF3 == 0x90
    reboot(tiny.uri)
    assert any(request[:2] == POWER_HEADER + b"\xfe" for request in tiny.requests)
