import collections
import socket

import numpy as np
import pytest

from mocap_bridge.bridge import PoseBridge
from mocap_bridge.datastream.objects import (
    OBJECT_IDS,
    CameraInfo,
    FrameInfo,
    GlobalSegments,
    LabeledReconstructions,
    ObjectEnums,
    PacketContents,
    Ping,
    RequestFrame,
    RequestNextFrame,
    SubjectInfo,
    Timecode,
    UnlabeledReconstructions,
)
from mocap_bridge.datastream.packet import PacketBuffer, decode_packet, encode_packet
from mocap_bridge.errors import SourceLost
from mocap_bridge.health import PoseVerdict
from mocap_bridge.pose import open_pose_stream
from onboard.lab_time import open_timebase
from perchhw.lab_process import FREE_PORTS, LOCKSTEP, SimulatedLab
from sim_backend.room.markers import LAYOUT
from sim_backend.room.settings import RoomError, RoomFaults, RoomSettings
from tests.mocap.moving_room import MovingRoom
from tests.patience import PATIENCE_S
from tests.room_thread import RoomThread
from tests.tiers import some

WANTED = tuple(OBJECT_IDS[kind] for kind in (SubjectInfo, FrameInfo, GlobalSegments, PacketContents))


class RawClient:
    """A client that says exactly what the test says."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
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
            self._socket.settimeout(PATIENCE_S)
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
        assert min(np.diff(asked)) >= 1  # the cameras skip when the machine is busy
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
        assert [type(item) for item in got] == [PacketContents, SubjectInfo, FrameInfo, GlobalSegments]
        assert got[0].counts == ((2, 1), (5, 1), (9, 1))
        client.close()


def test_markers_timecode_and_cameras_are_there_for_who_wants_them():
    wanted = (CameraInfo, SubjectInfo, GlobalSegments, Timecode, LabeledReconstructions)
    ids = tuple(OBJECT_IDS[kind] for kind in (*wanted, UnlabeledReconstructions, FrameInfo))
    with MovingRoom(rate_hz=200.0, faults=RoomFaults(reflections=2)) as room:
        client = RawClient(room.vicon_port)
        client.receive()
        client.send(ObjectEnums(ids), RequestFrame(1))
        for _ in range(200):
            got = collections.defaultdict(list)
            for item in client.receive():
                got[type(item)].append(item)
            if got[GlobalSegments] and got[GlobalSegments][0].segments:
                break
        client.close()
    assert len({camera.name for camera in got[CameraInfo]}) == 8
    (subject,), (segments,), (labelled,) = got[SubjectInfo], got[GlobalSegments], got[LabeledReconstructions]
    assert [name for _, name in subject.markers] == ["cf1_1", "cf1_2", "cf1_3", "cf1_4"]
    rotation = np.reshape(segments.segments[0].rotation, (3, 3))
    places = 1e3 * np.array(LAYOUT) @ rotation.T + segments.segments[0].position
    np.testing.assert_allclose([marker.position for marker in labelled.markers], places, atol=1e-9)
    assert len(got[UnlabeledReconstructions][0].markers) == 2
    (time,), (frame,) = got[Timecode], got[FrameInfo]
    seconds = (time.hours * 60 + time.minutes) * 60 + time.seconds
    assert (seconds * 25 + time.frames) * 8 + time.subframe == frame.frame_id


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
            a, b, common = {}, {}, set()
            while len(common) < 40:
                for stream, seen in ((first, a), (second, b)):
                    sample = stream.read(PATIENCE_S)
                    seen[sample.frame] = sample.position
                common = set(a) & set(b)
        assert all(a[frame] == b[frame] for frame in common)
        with open_pose_stream(room.uri) as again:
            assert again.read(PATIENCE_S).frame > max(a)


def test_a_client_that_does_not_read_holds_up_nobody():
    with MovingRoom(rate_hz=500.0) as room:
        lazy = RawClient(room.vicon_port)
        lazy.send(ObjectEnums(WANTED), RequestFrame(1))
        with open_pose_stream(room.uri) as stream:
            frames = [stream.read(PATIENCE_S).frame for _ in range(500)]
        assert len(set(frames)) == 500
        lazy.close()


def test_rate_and_latency_are_as_set_and_reported():
    with MovingRoom(rate_hz=200.0, latency=0.010) as room, open_pose_stream(room.uri) as stream:
        samples = [stream.read(PATIENCE_S) for _ in range(200)]
    span = samples[-1].capture_time - samples[0].capture_time
    assert (samples[-1].frame - samples[0].frame) / span == pytest.approx(200.0, rel=0.25)
    # A busy machine adds to it, and reports that; more than can be believed of a Vicon counts as unknown.
    assert min(sample.latency for sample in samples if sample.latency is not None) >= 0.010


def test_jitter_bunches_the_frames_but_keeps_their_order_and_capture_times():
    faults = RoomFaults(jitter=0.02)
    with MovingRoom(faults=faults) as room, open_pose_stream(room.uri) as stream:
        samples = [stream.read(PATIENCE_S) for _ in range(150)]
    steps = np.diff([sample.frame for sample in samples])
    assert (steps >= 1).all()
    arrivals = np.diff([sample.receipt_time for sample in samples])[50:]
    captures = np.diff([sample.capture_time for sample in samples])[50:]
    assert arrivals.std() > 3e-3
    assert np.median(np.abs(captures - 0.01 * steps[50:])) < 0.3 * np.median(np.abs(arrivals - 0.01))


def test_dropped_frames_leave_gaps_in_the_count():
    with MovingRoom(faults=RoomFaults(drop=0.1)) as room, open_pose_stream(room.uri) as stream:
        frames = [stream.read(PATIENCE_S).frame for _ in range(150)]
    lost = frames[-1] - frames[0] + 1 - len(frames)
    assert lost >= 3


def test_bodies_vanish_when_the_feed_stops():
    with MovingRoom() as room, open_pose_stream(room.uri) as stream:
        while stream.read(PATIENCE_S).occluded:
            continue
        room.feeding.clear()
        while not stream.read(PATIENCE_S).occluded:
            continue
        room.feeding.set()
        while stream.read(PATIENCE_S).occluded:
            continue


@pytest.mark.parametrize(
    ("fault", "verdict", "end"),
    some(
        [
            ("mocap_freeze_at=1", PoseVerdict.FROZEN, PoseVerdict.LOST),
            ("mocap_occlude_at=1", PoseVerdict.OCCLUDED, PoseVerdict.LOST),
            ("mocap_flip180_at=1", PoseVerdict.FLIPPED, PoseVerdict.OK),
        ],
        3,
    ),
)
def test_faults_end_in_the_verdict_they_deserve(fault: str, verdict: PoseVerdict, end: PoseVerdict):
    seen: list[PoseVerdict] = []
    with (
        SimulatedLab("lab", (*FREE_PORTS, *LOCKSTEP, "--fault", fault)) as lab,
        open_timebase("watcher", lab.mocap[0]) as time,
    ):
        bridge = PoseBridge(lab.mocap[0], None, clock=time, on_sample=lambda _, given: seen.append(given))
        bridge.set_in_flight(True)
        with bridge:
            assert bridge.wait_for(lambda status: verdict in seen, 5.0)
            assert bridge.wait_for(lambda status: status.verdict is end, 3.0)


def test_a_room_that_dies_closes_its_connections_and_takes_no_more():
    with MovingRoom(faults=RoomFaults(dies_at=2.0)) as room:
        with open_pose_stream(room.uri) as stream, pytest.raises(SourceLost):
            collections.deque((stream.read(PATIENCE_S) for _ in range(1000)), maxlen=0)
        with pytest.raises(SourceLost):
            open_pose_stream(room.uri)


def test_a_taken_port_is_said():
    with socket.create_server(("127.0.0.1", 0)) as holder:
        settings = RoomSettings(vicon_port=holder.getsockname()[1], vicon_udp_port=0)
        with (
            pytest.raises(RoomError, match=r"is in use by another program.* give another port"),
            RoomThread(settings, np.random.default_rng(0)),
        ):
            pytest.fail("the room started on a taken port")
