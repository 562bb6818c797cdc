import math
import re
import socket
import sys
import threading
import time
from pathlib import Path

import pytest

from mocap_bridge.bridge import BridgeStatus, PoseBridge
from mocap_bridge.errors import MocapError, MocapUriError
from mocap_bridge.health import PoseVerdict
from mocap_bridge.rotation import Quaternion, Vector
from mocap_bridge.uri import SCHEMES, MocapScheme
from onboard.timebase import WallTime
from tests.mocap.moving_room import MovingRoom
from tests.mocap.test_vicon_source import GREETING, frame, pose, scripted_server
from tests.patience import PATIENCE_S, StandingClock, until


class Drone:
    """Takes poses as a drone's link does; may be slow or broken."""

    def __init__(self) -> None:
        self.poses: list[tuple[float, Vector, Quaternion]] = []
        self.gate = threading.Event()
        self.gate.set()
        self.taking = threading.Event()
        self.fails = False

    def send_pose(self, position: Vector, quaternion: Quaternion) -> None:
        self.taking.set()
        self.gate.wait(PATIENCE_S)
        if self.fails:
            raise MocapError("the radio fell off the desk")
        self.poses.append((time.monotonic(), position, quaternion))


def threads_of_bridges() -> set[str]:
    return {thread.name for thread in threading.enumerate()} & {"pose-reader", "pose-sender"}


def test_good_poses_reach_the_drone_in_order():
    """How soon and at what rate is measured in the lab's time and by the benchmark."""
    drone = Drone()
    seen: list[BridgeStatus] = []

    def good(status: BridgeStatus) -> bool:
        seen.append(status)
        return status.sent >= 150 and status.verdict is PoseVerdict.OK

    with MovingRoom() as room, PoseBridge(room.uri, drone) as bridge:
        assert bridge.wait_for(good, PATIENCE_S)
    status = seen[-1]
    assert status.connected
    assert status.error is None
    assert status.rate_hz > 0.0
    assert status.last_good is not None
    assert status.age is not None
    assert status.age > 0.0
    assert status.residence_p50 is not None
    assert status.residence_p99 is not None
    assert 0.0 < status.residence_p50 <= status.residence_p99
    assert status.sink_errors == 0
    for _, (x, y, z), quaternion in drone.poses:
        assert math.hypot(x, y) == pytest.approx(1.0, abs=1e-3)
        assert z == pytest.approx(1.0, abs=1e-3)
        assert math.hypot(*quaternion) == pytest.approx(1.0, abs=1e-6)


def test_every_sample_is_reported_with_its_verdict():
    seen = []
    with MovingRoom() as room:
        bridge = PoseBridge(room.uri, None, on_sample=lambda sample, verdict: seen.append((sample, verdict)))
        with bridge:
            assert bridge.wait_for(lambda status: status.health.good >= 20, PATIENCE_S)
    assert [verdict for _, verdict in seen[:10]].count(PoseVerdict.OK) <= 1
    assert PoseVerdict.OK in [verdict for _, verdict in seen[10:]]


def test_a_slow_drone_gets_the_newest_pose_and_delays_nothing():
    drone = Drone()
    with MovingRoom() as room, PoseBridge(room.uri, drone) as bridge:
        assert bridge.wait_for(lambda status: status.sent >= 5, PATIENCE_S)
        drone.gate.clear()
        before = bridge.status()
        assert bridge.wait_for(lambda status: status.health.good >= before.health.good + 50, PATIENCE_S)
        during = bridge.status()
        assert during.last_good is not None
        assert during.sent <= before.sent + 1
        drone.gate.set()
        released = time.monotonic()
        assert bridge.wait_for(lambda status: status.sent >= during.sent + 2, PATIENCE_S)
        assert bridge.status().superseded >= 45
    after = [entry for entry in drone.poses if entry[0] >= released]
    # Right after the blocked pose comes one of now, not the backlog of half a second.
    angle = math.atan2(after[1][1][1], after[1][1][0])
    newest = during.last_good.capture_time - room.start_time
    assert math.remainder(angle - newest, 2 * math.pi) > -0.25


def test_a_failing_sink_is_reported_and_does_not_end_the_bridge():
    drone = Drone()
    drone.fails = True
    with MovingRoom() as room, PoseBridge(room.uri, drone) as bridge:
        assert bridge.wait_for(lambda status: status.sink_errors >= 3, PATIENCE_S)
        assert bridge.status().sink_error == "the radio fell off the desk"
        drone.fails = False
        assert bridge.wait_for(lambda status: status.sent >= 3, PATIENCE_S)


def test_nothing_is_forwarded_while_the_world_is_gone():
    drone = Drone()
    with MovingRoom() as room, PoseBridge(room.uri, drone) as bridge:
        assert bridge.wait_for(lambda status: status.verdict is PoseVerdict.OK, PATIENCE_S)
        room.feeding.clear()
        assert bridge.wait_for(lambda status: status.verdict is PoseVerdict.LOST, PATIENCE_S)
        before = bridge.status()
        assert bridge.wait_for(lambda status: status.health.samples >= before.health.samples + 20, PATIENCE_S)
        assert bridge.status().sent == before.sent
        room.feeding.set()
        assert bridge.wait_for(lambda status: status.verdict is PoseVerdict.OK, PATIENCE_S)


def test_a_server_that_dies_is_found_again():
    drone = Drone()
    with MovingRoom() as first:
        port = first.vicon_port
        bridge = PoseBridge(first.uri, drone)
        bridge.start()
        assert bridge.wait_for(lambda status: status.verdict is PoseVerdict.OK, PATIENCE_S)
    assert bridge.wait_for(lambda status: status.verdict is PoseVerdict.LOST, PATIENCE_S)
    status = bridge.status()
    assert not status.connected
    assert status.error is not None
    assert "no Vicon DataStream" in status.error or "closed" in status.error
    with MovingRoom(vicon_port=port):
        assert bridge.wait_for(lambda status: status.verdict is PoseVerdict.OK, PATIENCE_S)
        assert bridge.status().reconnects >= 1
    bridge.stop()


def test_a_silent_connection_is_given_up_after_half_a_second():
    clock = StandingClock()
    with scripted_server(GREETING, *[frame(i, pose(100.0 + i)) for i in range(20)]) as uri:
        bridge = PoseBridge(uri, None, clock=WallTime(clock))
        with bridge:
            assert bridge.wait_for(lambda status: status.health.samples == 20, PATIENCE_S)
            clock.now = 0.45
            threading.Event().wait(0.3)
            assert bridge.status().connected
            clock.now = 0.55
            assert bridge.wait_for(lambda status: "no frame" in (status.error or ""), PATIENCE_S)
            assert bridge.status().reconnects == 1


def test_a_wrong_subject_is_said_and_never_ok():
    drone = Drone()
    with MovingRoom(subjects=("cf1", "cf2")) as room:
        uri = room.uri.replace("subject=cf1", "subject=cf3")
        with PoseBridge(uri, drone) as bridge:
            assert bridge.wait_for(
                lambda status: "it offers: 'cf1', 'cf2'" in (status.error or ""), PATIENCE_S
            )
            assert bridge.status().verdict is PoseVerdict.UNKNOWN
    assert drone.poses == []


def test_stopping_ends_the_threads_while_running_and_connecting_and_leaves_a_stuck_sink_behind():
    drone = Drone()
    silent = socket.create_server(("127.0.0.1", 0))  # accepts in the kernel, never greets
    with silent, MovingRoom() as room:
        bridges = [
            PoseBridge(room.uri, drone),
            PoseBridge(f"vicon://127.0.0.1:{silent.getsockname()[1]}?subject=cf1", drone),
        ]
        for bridge in bridges:
            bridge.start()
        assert bridges[0].wait_for(lambda status: status.sent > 0, PATIENCE_S)
        for bridge in bridges:
            bridge.stop()
        until(lambda: not threads_of_bridges())
        stuck = PoseBridge(room.uri, drone)
        drone.gate.clear()
        drone.taking.clear()
        stuck.start()
        assert drone.taking.wait(PATIENCE_S)
        assert not stuck.stop()
        assert "pose-sender" in threads_of_bridges()
        drone.gate.set()
        until(lambda: not threads_of_bridges())


def test_bad_uri_and_second_start_are_errors():
    with pytest.raises(MocapUriError):
        PoseBridge("vicon://host", None)
    with (
        MovingRoom() as room,
        PoseBridge(room.uri, None) as bridge,
        pytest.raises(MocapError, match="already"),
    ):
        bridge.start()


def test_cpu_is_idle_while_disconnected():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with PoseBridge(f"vicon://127.0.0.1:{port}?subject=cf1", None) as bridge:
        before, start = time.thread_time(), time.process_time()
        assert not bridge.wait_for(lambda _: False, 1.0)
        own = time.thread_time() - before
        assert time.process_time() - start - own < 0.1


OWN_SOURCE = """
from mocap_bridge.pose import PoseSample, SourceStatistics


class Stream:
    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        pass

    def statistics(self):
        return SourceStatistics(1)

    def read(self, timeout_s):
        return PoseSample("cf1", 1, 0.0, 0.0, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0), False)


def open_own(uri, clock):
    return Stream()
"""


READ = "return PoseSample("
BODY = "class Stream:\n    "


@pytest.mark.parametrize(
    ("right", "wrong", "expected"),
    [
        (READ, f"1 / 0; {READ}", r"ZeroDivisionError: .* \(own_source.py:19\)"),
        (READ, f"__import__('json').loads(''); {READ}", r"JSONDecodeError: .* \(own_source.py:19\)"),
        ("(0.0, 0.0, 1.0)", "('a', 0.0, 1.0)", r"TypeError: .* \(health.py:\d+\)"),
        ("return SourceStatistics(1)", "return self.count", r"AttributeError: .* \(own_source.py:16\)"),
        ("def __enter__", "def enter", "TypeError: .*context manager.*"),
        (
            "def open_own",
            "def open_mine",
            "AttributeError: module 'own_source' has no attribute 'open_own'.*",
        ),
        ("return Stream()", "return Streams()", r"NameError: .* \(own_source.py:23\)"),
        ("class Stream:", "class Stream", r"SyntaxError: .* \(own_source.py, line 5\)"),
        (BODY, f"import a_vendor_sdk\n{BODY}", r"ModuleNotFoundError: .* \(own_source.py:5\)"),
        (BODY, f"raise RuntimeError('no licence')\n{BODY}", r"RuntimeError: no licence \(own_source.py:5\)"),
    ],
)
def test_a_source_that_breaks_says_why_and_gives_no_pose(
    right: str, wrong: str, expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As its reader ends, so does all that is known of where the drone is."""
    assert right in OWN_SOURCE
    (tmp_path / "own_source.py").write_text(OWN_SOURCE.replace(right, wrong))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "own_source", raising=False)
    scheme = MocapScheme("own_source.open_own", 4000, "own://?subject=cf1", needs_host=False)
    monkeypatch.setitem(SCHEMES, "own", scheme)
    with PoseBridge("own://?subject=cf1", None) as bridge:
        assert bridge.wait_for(lambda status: "bug" in (status.error or ""), PATIENCE_S)
        status = bridge.status()
    assert re.fullmatch(f"the source broke, which is a bug of it: {expected}", status.error or "")
    assert not status.connected
    assert status.verdict is not PoseVerdict.OK


@pytest.mark.parametrize("error", [RuntimeError, MocapError])
def test_a_listener_that_breaks_is_named_as_such_and_not_the_source(error: type[Exception]) -> None:
    def listen(*_: object) -> None:
        raise error("no room in the notebook")

    with MovingRoom() as room, PoseBridge(room.uri, None, on_sample=listen) as bridge:
        assert bridge.wait_for(lambda status: "bug" in (status.error or ""), PATIENCE_S)
        status = bridge.status()
    assert re.fullmatch(
        r"who listens to the poses \(on_sample\) broke, which is a bug of it: "
        rf"{error.__name__}: no room in the notebook \(test_bridge.py:\d+\)",
        status.error or "",
    )
    assert (status.connected, status.reconnects) == (False, 0)
    assert status.verdict is not PoseVerdict.OK
