import math
import socket
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from mocap_bridge.errors import PoseTimeout, SourceLost, UnknownSubject
from mocap_bridge.pose import open_pose_stream
from mocap_bridge.rotation import angle_between, quaternion_from_euler_xyz
from mocap_bridge.tracker_udp import TrackerItem, encode_blocks
from tests.mocap.moving_room import MovingRoom, samples_seen
from tests.patience import PATIENCE_S

ZERO = (0.0, 0.0, 0.0)


def body(name: str, x: float) -> TrackerItem:
    return TrackerItem(name, (x, 0.0, 1000.0), (0.1, 0.2, 0.3))


class Tracker:
    """Sends object-stream datagrams to a free port."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.uri = f"vicon-udp://127.0.0.1:{self.port}?subject=cf1"

    def send(self, frame: int, *items: TrackerItem, block_size: int = 256) -> None:
        for data in encode_blocks(frame, items, block_size):
            self.send_raw(data)

    def send_raw(self, data: bytes) -> None:
        self._socket.sendto(data, ("127.0.0.1", self.port))

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def tracker() -> Iterator[Tracker]:
    sender = Tracker()
    yield sender
    sender.close()


def open_while_sending(tracker: Tracker, *items: TrackerItem):
    """Open the stream; the datagrams that let it open come from another thread's room in real life."""
    stop = threading.Event()

    def send() -> None:
        while not stop.wait(0.005):
            tracker.send(0, *items)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        return open_pose_stream(tracker.uri)
    finally:
        stop.set()
        thread.join()


@pytest.mark.parametrize("block_size", [256, 512, 1024])
def test_follows_a_moving_body(block_size: int):
    with (
        MovingRoom(rate_hz=200.0, udp_block_size=block_size) as room,
        open_pose_stream(room.udp_uri) as stream,
    ):
        samples = samples_seen(stream, 100)
    for sample in samples:
        t = sample.capture_time - room.start_time
        assert sample.position is not None
        assert sample.quaternion is not None
        assert sample.latency is None
        assert sample.quality is None
        # Seen before it was received; how long before depends on the machine.
        seen = math.remainder(math.atan2(sample.position[1], sample.position[0]), 2 * math.pi)
        assert math.remainder(seen - t, 2 * math.pi) < 0.01
        assert angle_between(sample.quaternion, (0.0, 0.0, math.sin(seen / 2), math.cos(seen / 2))) < 0.01
    frames = np.diff([sample.frame for sample in samples])
    assert (frames >= 1).all()


def test_body_is_found_by_name_wherever_it_stands(tracker: Tracker):
    with open_while_sending(tracker, body("cf1", 1.0)) as stream:
        others = [body(f"other{i}", 5.0) for i in range(5)]
        tracker.send(1, body("cf1", 10.0), *others)
        tracker.send(2, *others, body("cf1", 20.0))  # in the second datagram of the frame
        tracker.send(3, others[0], body("cf1", 30.0))
        got = [stream.read(PATIENCE_S) for _ in range(3)]
        while got[-1].frame != 3:
            got = [*got[1:], stream.read(PATIENCE_S)]
    assert [(sample.frame, sample.position) for sample in got] == [
        (1, (0.01, 0.0, 1.0)),
        (2, (0.02, 0.0, 1.0)),
        (3, (0.03, 0.0, 1.0)),
    ]
    assert got[0].quaternion == pytest.approx(quaternion_from_euler_xyz(0.1, 0.2, 0.3))


def test_absent_zero_and_nan_are_no_pose(tracker: Tracker):
    with open_while_sending(tracker, body("cf1", 1.0)) as stream:
        tracker.send(11, body("other", 1.0))
        tracker.send(12, TrackerItem("cf1", ZERO, ZERO))
        tracker.send(13, TrackerItem("cf1", (math.nan, 0.0, 0.0), ZERO))
        tracker.send(14)
        tracker.send(15, body("cf1", 1.0))
        samples = [stream.read(PATIENCE_S)]
        while samples[-1].frame != 15:
            samples.append(stream.read(PATIENCE_S))
    tail = [sample for sample in samples if sample.frame > 10]
    assert [(sample.frame, sample.occluded) for sample in tail] == [
        (11, True), (12, True), (13, True), (14, True), (15, False),
    ]  # fmt: skip
    assert all(sample.position is None for sample in tail[:-1])


def test_foreign_datagrams_are_left_out_and_counted(tracker: Tracker):
    with open_while_sending(tracker, body("cf1", 1.0)) as stream:
        tracker.send_raw(b"not tracker")
        tracker.send_raw(b"\xff" * 256)
        tracker.send(21, body("cf1", 1.0))
        while stream.read(PATIENCE_S).frame != 21:
            continue
        assert stream.statistics().refused == 2


def test_silence_wrong_name_and_taken_port_are_said(tracker: Tracker):
    with pytest.raises(PoseTimeout, match="no Tracker object stream"):
        open_pose_stream(tracker.uri)
    with pytest.raises(UnknownSubject, match=r"no object 'cf1'.*'cf7', 'cf9'") as caught:
        open_while_sending(tracker, body("cf7", 1.0), body("cf9", 1.0))
    assert caught.value.offered == ("cf7", "cf9")
    with open_while_sending(tracker, body("cf1", 1.0)), pytest.raises(SourceLost, match="in use"):
        open_pose_stream(tracker.uri)


@pytest.mark.parametrize(("address", "bound"), [("", "127.0.0.1"), ("0.0.0.0", "0.0.0.0")])
def test_listens_beyond_this_computer_only_when_the_uri_says_so(
    tracker: Tracker, monkeypatch: pytest.MonkeyPatch, address: str, bound: str
):
    listening: list[str] = []

    class Noted(socket.socket):
        def bind(self, where: tuple[str, int]) -> None:
            super().bind(where)
            listening.append(self.getsockname()[0])

    monkeypatch.setattr(socket, "socket", Noted)
    tracker.uri = f"vicon-udp://{address}:{tracker.port}?subject=cf1"
    with open_while_sending(tracker, body("cf1", 10.0)):
        assert listening == [bound]


def test_who_hears_only_this_computer_is_told_how_to_hear_another(tracker: Tracker):
    uri = f"vicon-udp://:{tracker.port}?subject=cf1"
    with pytest.raises(PoseTimeout, match=rf"vicon-udp://0\.0\.0\.0:{tracker.port}\?subject=cf1"):
        open_pose_stream(uri)
    with pytest.raises(PoseTimeout) as caught:
        open_pose_stream(uri.replace("//:", "//0.0.0.0:"))
    assert "another" not in str(caught.value)


def test_an_address_of_another_computer_is_refused():
    with pytest.raises(SourceLost, match="no such address"):
        open_pose_stream("vicon-udp://192.0.2.1:51001?subject=cf1")
