"""The running lab as a process: unmodified cflib flies its drone on its room's poses; it ends cleanly."""

import contextlib
import errno
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cflib.crtp
import pytest
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.health import PoseVerdict
from onboard.taken_port import why_not_taken
from perchhw.cli.main import run
from tests.patience import PATIENCE_S, until
from tests.tiers import some

READY_S = 240.0  # the first start on a machine compiles everything
FREE_PORTS = ("--drone-port", "0", "--vicon-port", "0", "--vicon-udp-port", "0")


class LabProcess:
    """``perchhw sim PART`` and its ready line."""

    def __init__(self, *arguments: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "perchhw", "sim", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.ready: dict[str, Any] = {}

    def wait_ready(self) -> None:
        assert self.process.stdout is not None
        readable, _, _ = select.select([self.process.stdout], [], [], READY_S)
        line = self.process.stdout.readline() if readable else ""
        assert line, f"no ready line; stderr: {self.end(signal.SIGKILL)[1]}"
        self.ready = json.loads(line)

    def end(self, how: signal.Signals) -> tuple[int, str]:
        """Send a signal; exit code and what stderr said."""
        self.process.send_signal(how)
        _, errors = self.process.communicate(timeout=READY_S)
        return self.process.returncode, errors


@contextlib.contextmanager
def running(*arguments: str) -> Iterator[LabProcess]:
    lab = LabProcess(*arguments)
    try:
        lab.wait_ready()
        yield lab
    finally:
        if lab.process.poll() is None:
            lab.end(signal.SIGKILL)


def alive(pid: int) -> bool:
    """Whether a process that is not our child runs (a zombie does not)."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(")")[2].split()[0] != "Z"


class Telemetry:
    """Newest log values of a connected Crazyflie, with a way to wait for a condition on them."""

    def __init__(self, cf: Crazyflie, *names: str) -> None:
        self.values: dict[str, float] = {}
        self._stamp = 0
        self._changed = threading.Condition()
        config = LogConfig("test", 20)
        for name in names:
            config.add_variable(name, "float")
        cf.log.add_config(config)
        config.data_received_cb.add_callback(self._take)
        config.start()

    def _take(self, stamp: int, data: dict[str, float], _config: LogConfig) -> None:
        with self._changed:
            self.values, self._stamp = data, stamp
            self._changed.notify_all()

    def wait(self, what: str, condition: Any, seconds: float = PATIENCE_S) -> None:
        with self._changed:
            reached = self._changed.wait_for(lambda: bool(self.values) and condition(self.values), seconds)
        assert reached, f"{what}: not within {seconds} s, last {self.values}"

    def pass_time(self, milliseconds: int) -> None:
        """Wait so long by the drone's clock."""
        with self._changed:
            end = self._stamp + milliseconds
            assert self._changed.wait_for(lambda: self._stamp >= end, PATIENCE_S)

    def hold(self, what: str, condition: Any, seconds: float) -> None:
        with self._changed:
            left = self._changed.wait_for(lambda: not condition(self.values), seconds)
        assert not left, f"{what}: left it, {self.values}"


class CflibSink:
    """Poses into cflib, as a script of a stranger would do it."""

    def __init__(self, cf: Crazyflie) -> None:
        self._cf = cf

    def send_pose(self, position: tuple[float, ...], quaternion: tuple[float, ...]) -> None:
        self._cf.extpos.send_extpose(*position, *quaternion)


def assert_ready_line_is_the_contract(lab: LabProcess) -> None:
    assert lab.ready["ready"] is True
    assert lab.ready["drones"][0].startswith("udp://127.0.0.1:")
    assert lab.ready["mocap"][0].startswith("vicon://127.0.0.1:")
    assert lab.ready["mocap"][0].endswith("?subject=cf1")
    assert lab.ready["mocap"][1].startswith("vicon-udp://127.0.0.1:")
    assert lab.ready["processes"]["lab"] == lab.process.pid
    assert alive(lab.ready["processes"]["room"])


def test_unmodified_cflib_takes_off_on_poses_from_the_room(tmp_path: Path) -> None:
    cflib.crtp.init_drivers()
    truth_file = tmp_path / "truth.csv"
    with (
        running("lab", *FREE_PORTS, "--truth", str(truth_file)) as lab,
        SyncCrazyflie(lab.ready["drones"][0], cf=Crazyflie()) as link,
    ):
        cf = link.cf
        bridge = PoseBridge(lab.ready["mocap"][0], CflibSink(cf))
        bridge.start()
        try:
            names = ("stateEstimate.x", "stateEstimate.z", "kalman.varX", "supervisor.info", "pm.vbat")
            telemetry = Telemetry(cf, *names)
            telemetry.wait("estimate", lambda v: abs(v["stateEstimate.x"] + 2.5) < 0.02)
            assert bridge.wait_for(lambda status: status.verdict is PoseVerdict.OK, PATIENCE_S)
            assert telemetry.values["pm.vbat"] > 3.8
            telemetry.wait("may arm", lambda v: int(v["supervisor.info"]) & 1)
            cf.supervisor.send_arming_request(True)
            telemetry.wait("ready to fly", lambda v: int(v["supervisor.info"]) & 8)
            telemetry.pass_time(100)  # its planner learns within 10 ms where it is
            cf.high_level_commander.takeoff(0.5, 1.5)
            telemetry.wait("half a metre", lambda v: abs(v["stateEstimate.z"] - 0.5) < 0.03)
            telemetry.wait("flying", lambda v: int(v["supervisor.info"]) & 16)
            assert telemetry.values["stateEstimate.x"] == pytest.approx(-2.5, abs=0.05)
            telemetry.hold("half a metre", lambda v: abs(v["stateEstimate.z"] - 0.5) < 0.03, 1.0)
            true_z = float(truth_file.read_text(encoding="ascii").splitlines()[-2].split(",")[4])
            assert true_z == pytest.approx(0.5, abs=0.03)
            cf.high_level_commander.land(0.0, 1.5)
            telemetry.wait("motors off", lambda v: v["stateEstimate.z"] < 0.1)
        finally:
            bridge.stop()


@pytest.mark.further
def test_the_ready_line_names_a_room_that_can_die_alone() -> None:
    with running("lab", *FREE_PORTS) as lab:
        assert_ready_line_is_the_contract(lab)
        room = lab.ready["processes"]["room"]
        os.kill(room, signal.SIGKILL)
        until(lambda: not alive(room))
        host, port = lab.ready["drones"][0].removeprefix("udp://").split(":")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
            client.settimeout(PATIENCE_S)
            client.sendto(b"\xf3", (host, int(port)))  # link echo without data keeps the radio busy
            client.sendto(b"\xf0\x01\x02", (host, int(port)))
            assert client.recv(64)
        assert lab.process.stderr is not None
        assert any("mocap room has ended" in line for line in lab.process.stderr)  # waits for it
        assert lab.end(signal.SIGTERM)[0] == 0


@pytest.mark.parametrize(("how", "code"), some([(signal.SIGKILL, -9), (signal.SIGINT, 130)], 2))
def test_the_room_dies_with_the_lab(how: signal.Signals, code: int) -> None:
    with running("lab", *FREE_PORTS) as lab:
        room = lab.ready["processes"]["room"]
        assert lab.end(how)[0] == code
        until(lambda: not alive(room))


def test_room_alone_shows_resting_drones() -> None:
    with running("room", "--drones", "2", *FREE_PORTS[2:]) as lab:
        assert lab.ready["drones"] == []
        assert "lab" not in lab.ready, "a room without drones has no lab file"
        assert len(lab.ready["mocap"]) == 4
        seen = threading.Event()
        places: list[tuple[float, ...]] = []

        def take(sample: Any, verdict: PoseVerdict) -> None:
            if verdict is PoseVerdict.OK and sample.position is not None:
                places.append(sample.position)
                seen.set()

        bridge = PoseBridge(lab.ready["mocap"][1], None, on_sample=take)
        bridge.start()
        try:
            assert seen.wait(PATIENCE_S)
        finally:
            bridge.stop()
        assert places[-1] == pytest.approx((-2.5, 0.5, 0.07), abs=0.02)


def test_frozen_drone_is_silent() -> None:
    with running("drone", "--drone-port", "0", "--fault", "freeze_drone_at=0.5") as lab:
        assert lab.ready["mocap"] == []
        host, port = lab.ready["drones"][0].removeprefix("udp://").split(":")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
            client.settimeout(1.0)

            def silent() -> bool:
                client.sendto(b"\xf0\x01\x02", (host, int(port)))
                try:
                    client.recv(64)
                except TimeoutError:
                    return True
                return False

            until(silent)
            assert lab.process.poll() is None, "it has ended"


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("lab", "--fault", "gremlins=1"), 2, "gremlins"),
        (("lab", *FREE_PORTS, "--fault", "mocap_freeze_at=x"), 2, "mocap_freeze_at"),
        (("lab", *FREE_PORTS, "--vehicle", "zeppelin"), 2, "zeppelin"),
        (("lab", "--drones", "0"), 2, "drones"),
        (("drone", "--deck", "flow"), 2, "bcFlow2"),
    ],
)
def test_bad_input_is_refused(
    arguments: tuple[str, ...], code: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["sim", *arguments]) == code
    said = capsys.readouterr()
    assert words in said.err
    assert not said.out


def test_a_taken_port_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        assert run(["sim", "drone", "--drone-port", str(port)]) == 1
    said = capsys.readouterr().err
    assert f"no simulated drone: UDP port {port} on 127.0.0.1 is in use by another program (`ss -ulpn" in said
    assert "is a simulated lab running already?" in said
    assert "Errno" not in said


@pytest.mark.parametrize(("option", "kind"), [("--vicon-port", socket.SOCK_STREAM)])
def test_a_taken_port_of_the_room_is_named(
    option: str, kind: socket.SocketKind, capfd: pytest.CaptureFixture[str]
) -> None:
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert run(["sim", "room", option, str(port), "--vicon-udp-port", "0"]) == 1
    said = capfd.readouterr().err
    assert f"no simulated room: TCP port {port} on 127.0.0.1 is in use by another program" in said
    assert "Errno" not in said


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (errno.EACCES, "UDP port 80 on ::1 is not for this user: take one of 1024 or more"),
        (errno.EADDRNOTAVAIL, "UDP port 80 on ::1 cannot be taken: this computer has no such address"),
        (errno.ENOBUFS, "UDP port 80 on ::1 cannot be taken: No buffer space available"),
    ],
)
def test_why_a_port_cannot_be_taken(number: int, words: str) -> None:
    assert why_not_taken(OSError(number, os.strerror(number)), "UDP", "::1", 80) == words
