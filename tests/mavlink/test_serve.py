"""``perchhw mavlink serve``: a growing record, a finished one, a live drone; MAVProxy as a judge."""

import math
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from mocap_bridge.errors import MocapUriError
from onboard.supervisor_info import SupervisorBits
from onboard.timebase import WALL
from perchhw.cli.main import run
from perchhw.flight.ground_station import ground_station
from perchhw.lab_process import SimulatedLab
from perchhw.record import RunRecorder
from tests.mavlink.ground import Listener
from tests.mavlink.mavproxy_ground import MavproxyGround, needs_mavproxy
from tests.patience import PATIENCE_S

TURNED = (0.0, 0.0, math.sin(0.25), math.cos(0.25))
"""Half a radian to the left of x: a yaw of 90 deg - 28.6 deg in NED."""


def write(recorder: RunRecorder, t: float, x: float) -> None:
    """One moment of a flight at y = 2 m and 0.75 m high."""
    position = dict(zip("xyz", (x, 2.0, 0.75), strict=True))
    velocity = dict(zip(("vx", "vy", "vz"), (0.5, 0.0, 0.0), strict=True))
    recorder.write(
        "estimate", t, position | velocity | dict(zip(("qx", "qy", "qz", "qw"), TURNED, strict=True))
    )
    recorder.write("power", t, {"vbat": 3.9})


def numbers(shown: str, *fields: str) -> tuple[float, ...]:
    """Fields of a message as MAVProxy shows it."""
    found = [re.search(rf"\b{name} : (\S+?)[,}}]", shown) for name in fields]
    assert all(found), shown
    return tuple(float(match.group(1)) for match in found if match)


@contextmanager
def growing(folder: Path) -> Iterator[Callable[[], None]]:
    """A record that is written until the function that it gives is called."""
    enough = threading.Event()

    def fly() -> None:
        with RunRecorder(folder, {}) as recorder:
            begun.set()
            recorder.event("phase", WALL(), phase="approaching", aborted_by="fence: 0.3 m outside")
            deadline = WALL() + PATIENCE_S
            while not enough.wait(0.02) and WALL() < deadline:
                write(recorder, WALL(), 1.0)

    begun = threading.Event()
    writer = threading.Thread(target=fly)
    writer.start()
    assert begun.wait(PATIENCE_S)
    try:
        yield enough.set
    finally:
        enough.set()
        writer.join()


@contextmanager
def served(folder: Path, port: int) -> Iterator[None]:
    """``mavlink serve`` beside a record that is written for as long."""
    with growing(folder) as finish:
        command = ["mavlink", "serve", "--record", str(folder), "--to", f"mavlink://127.0.0.1:{port}"]
        codes: list[int] = []
        serving = threading.Thread(target=lambda: codes.append(run(command)))
        serving.start()
        try:
            yield
        finally:
            finish()
            serving.join()
    assert codes == [0]


def test_a_growing_record_is_followed_until_it_is_finished(tmp_path: Path) -> None:
    with Listener() as station, served(tmp_path / "run", station.port):
        assert station.until("STATUSTEXT", lambda m: m.text == "#1 aborted: fence: 0.3 m outside")
        position = station.until("LOCAL_POSITION_NED")
        assert (position.x, position.y, position.z) == (2.0, 1.0, -0.75)
        assert (position.vx, position.vy) == (0.0, 0.5)
        assert station.until("HEARTBEAT", lambda m: m.system_status == 5)


def test_a_finished_record_is_played_at_its_pace(tmp_path: Path) -> None:
    with RunRecorder(tmp_path / "run", {}) as recorder:
        for i in range(10):
            write(recorder, 100.0 + 0.05 * i, 0.1 * i)
        write(recorder, 900.0, 7.0)  # beyond --seconds
    with Listener() as station:
        to, begin = f"mavlink://127.0.0.1:{station.port}", WALL()
        assert run(["mavlink", "serve", "--record", str(tmp_path / "run"), "--to", to, "--seconds", "1"]) == 0
        took = WALL() - begin
        shown = [m for m in station.messages(0.2) if m.get_type() == "LOCAL_POSITION_NED"]
    assert took > 0.45
    assert all(round(m.time_boot_ms / 50) == round(m.y / 0.1) for m in shown)
    assert 1 < len(shown) <= 10


def test_a_drone_on_its_mark_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with SimulatedLab("drone", ("--drone-port", "0", "--pace", "2")) as lab, Listener() as station:
        to = f"mavlink://127.0.0.1:{station.port}"
        code = run(["mavlink", "serve", "--drone", lab.drones[0], "--to", to, "--seconds", "2"])
        messages = {message.get_type(): message for message in station.messages(0.2)}
    assert code == 0, capsys.readouterr().err
    assert abs(messages["LOCAL_POSITION_NED"].z) < 0.5
    assert messages["HEARTBEAT"].system_status == 3
    assert messages["BATTERY_STATUS"].voltages[0] == pytest.approx(4200, abs=200)
    assert not messages["SYS_STATUS"].onboard_control_sensors_present & 1 << 7  # nobody judges its poses


def test_what_the_drone_finds_is_said_once_and_shown() -> None:
    with Listener() as station, ground_station(f"mavlink://127.0.0.1:{station.port}") as listener:
        assert listener is not None
        flying = SupervisorBits.ARMED | SupervisorBits.CAN_FLY | SupervisorBits.FLYING
        for t in range(3):
            listener.write("supervisor", float(t), {"bits": int(flying)})
        assert station.until("HEARTBEAT", lambda m: m.system_status == 4).base_mode & 128
        for t in range(3, 6):
            listener.write("supervisor", float(t), {"bits": int(SupervisorBits.LOCKED)})
        said = station.until("STATUSTEXT", lambda m: m.id == 1).text
        assert said == "#1 the drone is locked: only a reboot helps"
        assert station.until("HEARTBEAT", lambda m: m.system_status == 5).base_mode & 128 == 0


@pytest.mark.parametrize("what", [[], ["--drone", "udp://127.0.0.1:1", "--record", "run"]])
def test_it_serves_one_of_the_two(what: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["mavlink", "serve", *what]) == 2
    assert "--drone" in capsys.readouterr().err


@pytest.mark.parametrize("drone", ["udp://[::1", "udp://127.0.0.1:1?time=127.0.0.1:99999"])
def test_an_address_that_is_none_is_told_as_such(drone: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["mavlink", "serve", "--drone", drone]) == 1
    assert drone in capsys.readouterr().err.replace("\n", "")


@pytest.mark.parametrize("host", ["no-such-host.invalid", "a..b"])
def test_a_ground_station_that_nobody_knows_is_said_before_anything_is_told(
    host: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with RunRecorder(tmp_path / "run", {}) as recorder:
        write(recorder, 0.0, 1.0)
    command = ["mavlink", "serve", "--record", str(tmp_path / "run"), "--to", f"mavlink://{host}:14550"]
    assert run(command) == 2
    shown = capsys.readouterr()
    assert f"no MAVLink to mavlink://{host}:14550" in shown.err
    assert not shown.out
    with pytest.raises(MocapUriError, match=re.escape(host)), ground_station(f"mavlink://{host}"):
        pytest.fail("a flight told it to nobody")


def test_a_file_is_no_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (file := tmp_path / "flight.csv").write_text("t,x\n0,1\n")
    with Listener() as station:
        to = f"mavlink://127.0.0.1:{station.port}"
        assert run(["mavlink", "serve", "--record", str(file), "--to", to]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "flight.csv is no run: give the folder of one, in which run.json is" in said


@needs_mavproxy
@pytest.mark.slow
def test_mavproxy_reads_it_and_may_not_arm(tmp_path: Path) -> None:
    with MavproxyGround(tmp_path) as station, served(tmp_path / "run", station.port):
        station.until(r"#1 aborted: fence: 0.3 m outside")
        told = station.until(r"LOCAL_POSITION_NED .*", asking="status").group()
        assert numbers(told, "x", "y", "z", "vx", "vy") == (2.0, 1.0, -0.75, 0.0, 0.5)
        w, x, y, z = numbers(
            station.until(r"ATTITUDE_QUATERNION .*", asking="status").group(), "q1", "q2", "q3", "q4"
        )
        assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-6)
        assert math.atan(z / w) == pytest.approx(math.pi / 4 - 0.25, abs=1e-6)
        station.until(r"BATTERY_STATUS .*voltages : \[3900,", asking="status")
        station.until(r"ARM_DISARM: DENIED", asking="arm throttle")
