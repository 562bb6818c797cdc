"""Poses in: from our own sink, from ArduPilot's dialect, and from MAVSDK."""

import math
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from mocap_bridge.errors import MocapUriError, PoseTimeout, SourceLost, UnknownSubject
from mocap_bridge.health import PoseVerdict
from mocap_bridge.mavlink.address import MavlinkAddress
from mocap_bridge.mavlink.pose_sink import MavlinkPoseSink, PoseMessage
from mocap_bridge.pose import PoseSample, PoseStream, open_pose_stream
from onboard.errors import InputError
from perchhw.lab import LabRequired, require_lab
from tests.mavlink.ground import free_port, needs_mavsdk

TURNED = tuple(float(v) for v in Rotation.from_euler("ZYX", (0.4, -0.3, 0.2)).as_quat())
NAN21 = [math.nan] + [0.0] * 20


@contextmanager
def repeating(send: Callable[[int], None]) -> Iterator[None]:
    """`send` with a growing number, 200 times a second."""
    stop = threading.Event()

    def repeat() -> None:
        number = 0
        while not stop.wait(0.005):
            number += 1
            send(number)

    thread = threading.Thread(target=repeat)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


class Sender:
    """Packs messages of another dialect as some system and sends them to a port."""

    def __init__(self, port: int, system: int = 9, key: bytes | None = None) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._port = port
        self._codec = mavlink.MAVLink(None, srcSystem=system, srcComponent=197)
        if key is not None:
            self._codec.signing.secret_key = key
            self._codec.signing.sign_outgoing = True
            self._codec.signing.timestamp = int((time.time() - 1_420_070_400) * 1e5)

    def send(self, *messages: Any) -> None:
        for message in messages:
            self._socket.sendto(message.pack(self._codec), ("127.0.0.1", self._port))
            self._codec.seq = (self._codec.seq + 1) % 256

    def close(self) -> None:
        self._socket.close()


def odometry(number: int, frame: int = 1, child: int = 12, quality: int = 0) -> Any:
    return mavlink.MAVLink_odometry_message(
        5000 * number,
        frame,
        child,
        1.0,
        2.0,
        -3.0,
        [1.0, 0.0, 0.0, 0.0],
        *[0.0] * 6,
        NAN21,
        NAN21,
        0,
        6,
        quality,
    )


def opened(uri: str) -> PoseStream:
    """The source, as soon as the sender has begun."""
    deadline = time.monotonic() + 60.0
    while True:
        try:
            return open_pose_stream(uri)
        except PoseTimeout:
            assert time.monotonic() < deadline


@pytest.mark.parametrize("kind", PoseMessage)
def test_what_goes_out_comes_in(kind: PoseMessage) -> None:
    port = free_port()
    with MavlinkPoseSink(MavlinkAddress("127.0.0.1", port, None), kind) as sink:

        def send(frame: int) -> None:
            now = time.monotonic()
            pose = PoseSample("cf1", frame, now, now, (1.25, -2.5, 0.75), TURNED, False, None, None)
            sink.on_sample(pose, PoseVerdict.OK)

        with repeating(send), opened(f"mavlink://:{port}") as stream:
            got = [stream.read(60.0) for _ in range(50)]
    assert [sample.frame for sample in got] == list(range(1, 51))
    for sample in got:
        np.testing.assert_allclose(sample.position, (1.25, -2.5, 0.75), atol=1e-6)
        between = Rotation.from_quat(TURNED).inv() * Rotation.from_quat(sample.quaternion)
        assert math.degrees(between.magnitude()) < 1e-3
        assert sample.capture_time <= sample.receipt_time


@needs_mavsdk
@pytest.mark.parametrize("kind", PoseMessage)
def test_mavsdk_feeds_poses(kind: PoseMessage) -> None:
    port = free_port()
    script = Path(__file__).with_name("mavsdk_mocap.py")
    listener = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    listener.bind(("127.0.0.1", port))
    listener.settimeout(60.0)
    child = subprocess.Popen(
        [sys.executable, str(script), str(port), kind.value],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        _, source = listener.recvfrom(2048)  # it sends poses only to somebody who looks like a vehicle
        vehicle = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        listener.sendto(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(vehicle), source)
        listener.close()
        with opened(f"mavlink://:{port}?subject=42") as stream:
            sample = stream.read(60.0)
    finally:
        child.kill()
        child.wait()
        listener.close()
    np.testing.assert_allclose(sample.position, (2.0, 1.0, 3.0), atol=1e-6)
    axes = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    theirs = Rotation.from_euler("ZYX", (0.4, -0.3, 0.2)).as_matrix()
    expected = Rotation.from_matrix(axes @ theirs @ np.diag([1.0, -1.0, -1.0]))
    assert math.degrees((expected.inv() * Rotation.from_quat(sample.quaternion)).magnitude()) < 1e-3


def test_a_pose_that_comes_in_two_messages_is_one_sample_and_other_systems_are_not_heard() -> None:
    port = free_port()
    ours, others = Sender(port, 9), Sender(port, 10)

    def send(number: int) -> None:
        mocap = mavlink.MAVLink_att_pos_mocap_message(5000 * number, [1, 0, 0, 0], 1.0, 2.0, -3.0, NAN21)
        ours.send(odometry(number), mocap)
        others.send(mavlink.MAVLink_att_pos_mocap_message(5000 * number, [1, 0, 0, 0], 9.0, 9.0, 9.0, NAN21))

    with repeating(send), opened(f"mavlink://:{port}?subject=9") as stream:
        samples = [stream.read(60.0) for _ in range(20)]
        assert set(stream.statistics().subjects) == {"9", "10"}
    assert {sample.position for sample in samples} == {(2.0, 1.0, 3.0)}
    assert all(a.source_time < b.source_time for a, b in pairwise(samples))
    ours.close()
    others.close()


def test_a_failed_fit_is_occluded_and_unknown_axes_are_refused() -> None:
    port = free_port()
    sender = Sender(port)
    with (
        repeating(lambda n: sender.send(odometry(n, quality=-1 if n % 2 else 0), odometry(n, frame=4))),
        opened(f"mavlink://:{port}") as stream,
    ):
        samples = [stream.read(60.0) for _ in range(20)]
        assert stream.statistics().refused > 0
    assert {sample.occluded for sample in samples} == {True, False}
    assert all((sample.position is None) == sample.occluded for sample in samples)
    sender.close()


def test_with_a_key_unsigned_poses_are_not_taken(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_text(bytes(range(32)).hex())
    port = free_port()
    forged, signed = Sender(port, 9), Sender(port, 10, bytes(range(32)))
    uri = f"mavlink://:{port}?key={key}"
    with repeating(lambda n: forged.send(odometry(n))), pytest.raises(PoseTimeout, match="packets refused"):
        open_pose_stream(uri)
    with repeating(lambda n: (forged.send(odometry(n)), signed.send(odometry(n)))), opened(uri) as stream:
        stream.read(60.0)
        assert stream.statistics().subjects == ("10",)
    forged.close()
    signed.close()


def test_silence_a_taken_port_and_strangers_say_what_they_are() -> None:
    port = free_port()
    with pytest.raises(PoseTimeout, match="no MAVLink arrives"):
        open_pose_stream(f"mavlink://:{port}")
    sender = Sender(port)
    heartbeat = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
    with repeating(lambda _: sender.send(heartbeat)), pytest.raises(UnknownSubject, match="systems heard: 9"):
        open_pose_stream(f"mavlink://:{port}?subject=3")
    sender.close()
    with pytest.raises(MocapUriError, match="1 to 255"):
        open_pose_stream(f"mavlink://:{port}?subject=cf1")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", port))
        with pytest.raises(SourceLost, match="in use"):
            open_pose_stream(f"mavlink://:{port}")


def test_poses_from_elsewhere_need_a_lab_file() -> None:
    require_lab("udp://127.0.0.1:19850", "mavlink://:14551", None)
    with pytest.raises(LabRequired):
        require_lab("udp://127.0.0.1:19850", "mavlink://0.0.0.0:14551", None)
    with pytest.raises(InputError, match="another time"):
        require_lab("udp://127.0.0.1:19850", "file:///tmp/run", None)
