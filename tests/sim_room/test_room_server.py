import collections
import socket
import time

import numpy as np
import pytest

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.datastream.objects import (
    OBJECT_IDS,
    Contents,
    FrameInfo,
    GlobalSegments,
    ObjectEnums,
    Ping,
    RequestFrame,
    RequestNextFrame,
    SubjectInfo,
)
from mocap_bridge.datastream.packet import PacketBuffer, decode_packet, encode_packet
from mocap_bridge.errors import SourceLost
from mocap_bridge.health import Verdict
from mocap_bridge.pose import open_pose_stream
from sim_backend.room.settings import RoomError, RoomFaults, RoomSettings, Window
from tests.mocap.moving_room import MovingRoom
from tests.room_thread import RoomThread

WANTED = tuple(OBJECT_IDS[kind] for kind in (SubjectInfo, FrameInfo, GlobalSegments, Contents))


class RawClient:
    """A client that says exactly what the test says."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=2.0)
        self._buffer = PacketBuffer()

    def send(self, *objects) -> None:
        self._socket.sendall(encode_packet(objects))

    def receive(self):
        while (packet := self._buffer.next_packet()) is None:
            data = self._socket.recv(65536)
            if not data:
                raise EOFError
            self._buffer.feed(data)
        return decode_packet(packet)

    def silent_for(self, seconds: float) -> bool:
        self._socket.settimeout(seconds)
        try:
            self.receive()
        except TimeoutError:
            return True
        finally:
            self._socket.settimeout(2.0)
        return False

    def close(self) -> None:
        self._socket.close()


def frame_number(objects) -> int:
    return next(item.frame_id for item in objects if isinstance(item, FrameInfo))


def test_server_speaks_first_and_sends_nothing_unasked():
    with MovingRoom() as room:
        client = RawClient(room.vicon_port)
        (greeting,) = client.receive()
        assert isinstance(greeting, ObjectEnums)
        assert {1, 2, 5, 9, 26, 37, 40, 42, 100004} <= set(greeting.ids)
        assert client.silent_for(0.1)
        client.close()


def test_client_pull_gives_one_frame_a_request():
    with MovingRoom() as room:
        client = RawClient(room.vicon_port)
        client.receive()
        client.send(ObjectEnums(WANTED))
        client.send(RequestNextFrame(1))
        numbers = [frame_number(client.receive())]
        for _ in range(5):
            client.send(RequestFrame(0))
            numbers.append(frame_number(client.receive()))
        assert numbers == sorted(numbers)
        assert client.silent_for(0.1)
        client.send(RequestNextFrame(3))
        asked = [frame_number(client.receive()) for _ in range(3)]
        assert np.diff(asked).tolist() == [1, 1]
        assert asked[0] > numbers[-1]
        assert client.silent_for(0.1)
        client.close()


def test_a_client_gets_only_what_it_wants_and_may_want_more_later():
    with MovingRoom() as room:
        client = RawClient(room.vicon_port)
        client.receive()
        client.send(ObjectEnums((5, 4711)))
        client.send(RequestFrame(1))
        assert {type(item) for item in client.receive()} == {FrameInfo}
        client.send(ObjectEnums(WANTED))
        for _ in range(20):
            got = client.receive()
            if len(got) > 1:
                break
        assert [type(item) for item in got] == [Contents, SubjectInfo, FrameInfo, GlobalSegments]
        assert got[0].counts == ((2, 1), (5, 1), (9, 1))
        client.close()


def test_pings_are_echoed_and_garbage_ends_only_its_own_connection():
    with MovingRoom() as room:
        good, bad = RawClient(room.vicon_port), RawClient(room.vicon_port)
        good.receive(), bad.receive()
        good.send(Ping(123456789))
        assert good.receive() == [Ping(123456789)]
        bad._socket.sendall(b"GET / HTTP/1.0\r\n\r\n")
        with pytest.raises((EOFError, ConnectionResetError)):
            bad.receive()
        good.send(Ping(2))
        assert good.receive() == [Ping(2)]
        good.close(), bad.close()


def test_several_clients_get_the_same_frames_and_reconnect():
    with MovingRoom() as room:
        with open_pose_stream(room.uri) as first, open_pose_stream(room.uri) as second:
            a = {sample.frame: sample.position for sample in (first.read(1.0) for _ in range(50))}
            b = {sample.frame: sample.position for sample in (second.read(1.0) for _ in range(50))}
        common = set(a) & set(b)
        assert len(common) >= 40
        assert all(a[frame] == b[frame] for frame in common)
        with open_pose_stream(room.uri) as again:
            assert again.read(1.0).frame > max(a)


def test_a_client_that_does_not_read_holds_up_nobody():
    with MovingRoom(rate_hz=500.0) as room:
        lazy = RawClient(room.vicon_port)
        lazy.send(ObjectEnums(WANTED), RequestFrame(1))
        with open_pose_stream(room.uri) as stream:
            frames = [stream.read(1.0).frame for _ in range(500)]
        assert frames[-1] - frames[0] < 600
        lazy.close()


def test_rate_and_latency_are_as_set_and_reported():
    with MovingRoom(rate_hz=200.0, latency=0.010) as room, open_pose_stream(room.uri) as stream:
        samples = [stream.read(1.0) for _ in range(200)]
    span = samples[-1].receipt_time - samples[0].receipt_time
    assert (samples[-1].frame - samples[0].frame) / span == pytest.approx(200.0, rel=0.03)
    latencies = [sample.latency for sample in samples]
    assert 0.010 <= np.median(latencies) <= 0.013


def test_jitter_bunches_the_frames_but_keeps_their_order_and_capture_times():
    faults = RoomFaults(jitter=0.02)
    with MovingRoom(faults=faults) as room, open_pose_stream(room.uri) as stream:
        samples = [stream.read(1.0) for _ in range(150)]
    assert (np.diff([sample.frame for sample in samples]) == 1).all()
    arrivals = np.diff([sample.receipt_time for sample in samples[50:]])
    captures = np.diff([sample.capture_time for sample in samples[50:]])
    assert arrivals.std() > 3e-3
    assert np.percentile(np.abs(captures - 0.01), 95) < 1e-3


def test_dropped_frames_leave_gaps_in_the_count():
    with MovingRoom(faults=RoomFaults(drop=0.1)) as room, open_pose_stream(room.uri) as stream:
        frames = [stream.read(1.0).frame for _ in range(150)]
    lost = frames[-1] - frames[0] + 1 - len(frames)
    assert 3 <= lost <= 40


def test_bodies_vanish_when_the_feed_stops():
    with MovingRoom() as room, open_pose_stream(room.uri) as stream:
        while stream.read(1.0).occluded:
            continue
        room.feeding.clear()
        stopped = time.monotonic()
        while not (sample := stream.read(1.0)).occluded:
            continue
        assert sample.receipt_time - stopped < 0.15
        room.feeding.set()
        while stream.read(1.0).occluded:
            continue


@pytest.mark.parametrize(
    ("faults", "verdict"),
    [
        (RoomFaults(freeze=Window(1.0)), Verdict.FROZEN),
        (RoomFaults(occlude=Window(1.0)), Verdict.OCCLUDED),
        (RoomFaults(flip180=Window(1.0, 1.01)), Verdict.FLIPPED),
    ],
)
def test_faults_end_in_the_verdict_they_deserve(faults: RoomFaults, verdict: Verdict):
    seen: list[Verdict] = []
    with MovingRoom(faults=faults) as room:
        bridge = PoseBridge(room.uri, None, on_sample=lambda _, given: seen.append(given))
        bridge.set_in_flight(True)
        with bridge:
            assert bridge.wait_for(lambda status: verdict in seen, 5.0)
            assert bridge.wait_for(
                lambda status: status.verdict is (Verdict.OK if verdict is Verdict.FLIPPED else Verdict.LOST),
                3.0,
            )


def test_a_room_that_dies_closes_its_connections_and_takes_no_more():
    with MovingRoom(faults=RoomFaults(dies_at=0.5)) as room:
        with open_pose_stream(room.uri) as stream, pytest.raises(SourceLost):
            collections.deque((stream.read(1.0) for _ in range(1000)), maxlen=0)
        with pytest.raises(SourceLost):
            open_pose_stream(room.uri)


def test_a_taken_port_is_said():
    with socket.create_server(("127.0.0.1", 0)) as holder:
        settings = RoomSettings(vicon_port=holder.getsockname()[1], vicon_udp_port=0)
        with (
            pytest.raises(RoomError, match="choose another port"),
            RoomThread(settings, np.random.default_rng(0)),
        ):
            pytest.fail("the room started on a taken port")
