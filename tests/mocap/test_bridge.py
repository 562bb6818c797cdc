import math
import socket
import threading
import time

import pytest

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.errors import MocapError, MocapUriError
from mocap_bridge.health import Verdict
from mocap_bridge.rotation import Quaternion, Vector
from mocap_bridge.sinks.crazyflie import CrazyfliePoseSink
from tests.mocap.moving_room import MovingRoom
from tests.mocap.test_vicon_source import GREETING, frame, pose, scripted_server


class Drone:
    """Takes poses as a drone's link does; may be slow or broken."""

    def __init__(self) -> None:
        self.poses: list[tuple[float, Vector, Quaternion]] = []
        self.gate = threading.Event()
        self.gate.set()
        self.fails = False

    def send_pose(self, position: Vector, quaternion: Quaternion) -> None:
        self.gate.wait(5.0)
        if self.fails:
            raise MocapError("the radio fell off the desk")
        self.poses.append((time.monotonic(), position, quaternion))


def running(uri: str, drone: Drone, **options) -> PoseBridge:
    return PoseBridge(uri, CrazyfliePoseSink(drone), **options)


def test_good_poses_reach_the_drone_in_order_and_in_time():
    drone = Drone()
    with MovingRoom() as room, running(room.uri, drone) as bridge:
        assert bridge.wait_for(lambda status: status.sent >= 150, 5.0)
        status = bridge.status()
    assert status.verdict is Verdict.OK
    assert status.connected
    assert status.error is None
    # Loose, because the simulated cameras skip on a busy machine; the benchmark has the figures.
    assert status.rate_hz == pytest.approx(100.0, abs=20.0)
    assert status.last_good is not None
    assert status.age is not None
    assert status.age < 0.1
    assert status.residence_p50 is not None
    assert status.residence_p50 < 5e-3
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
            assert bridge.wait_for(lambda status: status.health.good >= 20, 5.0)
    assert [verdict for _, verdict in seen[:10]].count(Verdict.OK) <= 1
    assert seen[-1][1] is Verdict.OK


def test_a_slow_drone_gets_the_newest_pose_and_delays_nothing():
    drone = Drone()
    with MovingRoom() as room, running(room.uri, drone) as bridge:
        assert bridge.wait_for(lambda status: status.sent >= 5, 5.0)
        drone.gate.clear()
        before = bridge.status()
        assert bridge.wait_for(lambda status: status.health.good >= before.health.good + 50, 5.0)
        during = bridge.status()
        assert during.verdict is Verdict.OK
        assert during.sent <= before.sent + 1
        drone.gate.set()
        released = time.monotonic()
        assert bridge.wait_for(lambda status: status.sent >= during.sent + 2, 5.0)
        assert bridge.status().superseded >= 45
    after = [entry for entry in drone.poses if entry[0] >= released]
    # Right after the blocked pose comes one of now, not the backlog of half a second.
    angle = math.atan2(after[1][1][1], after[1][1][0])
    assert abs(math.remainder(angle - (after[1][0] - room.start_time), 2 * math.pi)) < 0.04


def test_a_failing_sink_is_reported_and_does_not_end_the_bridge():
    drone = Drone()
    drone.fails = True
    with MovingRoom() as room, running(room.uri, drone) as bridge:
        assert bridge.wait_for(lambda status: status.sink_errors >= 3, 5.0)
        assert bridge.status().sink_error == "the radio fell off the desk"
        drone.fails = False
        assert bridge.wait_for(lambda status: status.sent >= 3, 5.0)


def test_nothing_is_forwarded_while_the_world_is_gone():
    drone = Drone()
    with MovingRoom() as room, running(room.uri, drone) as bridge:
        assert bridge.wait_for(lambda status: status.verdict is Verdict.OK, 5.0)
        room.feeding.clear()
        assert bridge.wait_for(lambda status: status.verdict is Verdict.STALE, 5.0)
        sent = bridge.status().sent
        assert bridge.wait_for(lambda status: status.verdict is Verdict.LOST, 5.0)
        assert bridge.status().sent == sent
        room.feeding.set()
        assert bridge.wait_for(lambda status: status.verdict is Verdict.OK, 5.0)


def test_a_server_that_dies_is_found_again():
    drone = Drone()
    with MovingRoom() as first:
        port = first.vicon_port
        bridge = running(first.uri, drone)
        bridge.start()
        assert bridge.wait_for(lambda status: status.verdict is Verdict.OK, 5.0)
    assert bridge.wait_for(lambda status: status.verdict is Verdict.LOST, 5.0)
    status = bridge.status()
    assert not status.connected
    assert status.error is not None
    assert "no Vicon DataStream" in status.error or "closed" in status.error
    with MovingRoom(vicon_port=port):
        # Back-off is at most 1 s; then ten good samples.
        assert bridge.wait_for(lambda status: status.verdict is Verdict.OK, 3.0)
        assert bridge.status().reconnects == 1
        assert bridge.status().error is None
    assert bridge.stop()


def test_a_silent_connection_is_given_up_within_half_a_second():
    with scripted_server(GREETING, *[frame(i, pose(100.0 + i)) for i in range(20)]) as uri:
        bridge = PoseBridge(uri, None)
        with bridge:
            assert bridge.wait_for(lambda status: status.health.samples == 20, 2.0)
            start = time.monotonic()
            assert bridge.wait_for(lambda status: status.reconnects == 1, 2.0)
            assert time.monotonic() - start < 0.8
            error = bridge.status().error
            assert error is not None
            assert "no frame" in error


def test_a_wrong_subject_is_said_and_never_ok():
    drone = Drone()
    with MovingRoom(subjects=("cf1", "cf2")) as room:
        uri = room.uri.replace("subject=cf1", "subject=cf3")
        with running(uri, drone) as bridge:
            assert bridge.wait_for(lambda status: "it offers: 'cf1', 'cf2'" in (status.error or ""), 2.0)
            assert bridge.status().verdict is Verdict.UNKNOWN
    assert drone.poses == []


def test_stopping_is_quick_while_running_while_connecting_and_with_a_stuck_sink():
    drone = Drone()
    silent = socket.create_server(("127.0.0.1", 0))  # accepts in the kernel, never greets
    with silent, MovingRoom() as room:
        bridges = [
            running(room.uri, drone),
            PoseBridge(f"vicon://127.0.0.1:{silent.getsockname()[1]}?subject=cf1", drone),
        ]
        for bridge in bridges:
            bridge.start()
        assert bridges[0].wait_for(lambda status: status.sent > 0, 5.0)
        for bridge in bridges:
            start = time.monotonic()
            assert bridge.stop()
            assert time.monotonic() - start < 0.5
        stuck = running(room.uri, drone)
        drone.gate.clear()
        stuck.start()
        assert stuck.wait_for(lambda status: status.superseded > 0, 5.0)
        start = time.monotonic()
        assert not stuck.stop()
        assert time.monotonic() - start < 0.6
        drone.gate.set()


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
        assert time.process_time() - start - own < 0.05
