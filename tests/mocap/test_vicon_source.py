import math
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise

import numpy as np
import pytest

from mocap_bridge.datastream.objects import (
    ApplicationInfo,
    FrameInfo,
    GlobalSegments,
    LatencyInfo,
    ObjectEnums,
    Segment,
    SegmentPose,
    StreamInfo,
    SubjectInfo,
)
from mocap_bridge.datastream.packet import MAGIC, encode_packet
from mocap_bridge.errors import PoseTimeout, SourceLost, SourceUnusable, UnknownSubject
from mocap_bridge.pose import open_pose_stream
from mocap_bridge.rotation import angle_between, dot
from onboard.timebase import WallTime
from tests.mocap.moving_room import MovingRoom, samples_seen
from tests.patience import PATIENCE_S, StandingClock

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
GREETING = encode_packet([ObjectEnums((1, 2, 5, 9, 26, 37, 40, 42, 100004))])
CF1 = SubjectInfo(3, "cf1", (Segment(0, 1, (0.0,) * 6, "cf1"), Segment(1, 2, (0.0,) * 6, "arm")), (), ())


def frame(number: int, *segments: SegmentPose, extra: tuple = ()) -> bytes:
    return encode_packet(
        [StreamInfo(1350000), CF1, FrameInfo(number), *extra, GlobalSegments(3, tuple(segments))]
    )


def pose(x: float, matrix=IDENTITY) -> SegmentPose:
    return SegmentPose(1, (x, 200.0, 300.0), matrix)


@contextmanager
def scripted_server(*answers: bytes, stay_open: bool = True) -> Iterator[str]:
    """Greets and sends `answers`, whatever the client says; then stays silent or closes."""
    listener = socket.create_server(("127.0.0.1", 0))
    done = threading.Event()

    def serve() -> None:
        connection, _ = listener.accept()
        with connection:
            for answer in answers:
                connection.sendall(answer)
            if not stay_open:
                connection.shutdown(socket.SHUT_WR)
            done.wait(PATIENCE_S)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        yield f"vicon://127.0.0.1:{listener.getsockname()[1]}?subject=cf1"
    finally:
        done.set()
        thread.join()
        listener.close()


def after_a_second() -> WallTime:
    """Deadlines of half a second come when a second has passed: what was to come has come by then."""
    begin = time.monotonic()
    return WallTime(lambda: float(time.monotonic() - begin > 1.0))


def test_follows_a_moving_body_frame_by_frame():
    with MovingRoom(rate_hz=200.0) as room, open_pose_stream(room.uri) as stream:
        while stream.read(PATIENCE_S).position is None:
            pass  # cameras that are on before the body is there
        samples = samples_seen(stream, 300)
        statistics = stream.statistics()
    frames = [sample.frame for sample in samples]
    # In order, each once; the simulated cameras skip when the machine is busy.
    assert (np.diff(frames) >= 1).all()
    assert statistics.subjects == ("cf1",)
    assert statistics.period == pytest.approx(1 / 200)
    assert statistics.round_trip is not None
    assert statistics.round_trip > 0.0
    assert any(sample.latency is not None for sample in samples)
    errors, angles = [], []
    for previous, sample in pairwise(samples):
        assert sample.position is not None
        assert sample.quaternion is not None
        assert math.hypot(*sample.quaternion) == pytest.approx(1.0, abs=1e-9)
        assert previous.quaternion is not None
        assert dot(sample.quaternion, previous.quaternion) > 0.0
        assert sample.quality == 1.0
        if sample.latency is not None:  # a busy machine adds more than can be believed of cameras
            assert sample.latency >= 0.004
        t = sample.capture_time - room.start_time
        truth = (math.cos(t), math.sin(t), 1.0)
        errors.append(math.dist(sample.position, truth))
        angles.append(angle_between(sample.quaternion, (0.0, 0.0, math.sin(t / 2), math.cos(t / 2))))
    # 1 m/s: the capture time is right to a millisecond or so, not to the 4-5 ms of latency. On a busy machine
    # only of the frames that were received in time.
    assert min(errors) < 2e-3
    assert min(angles) < 2e-3


def test_an_absent_segment_is_occlusion_and_never_a_zero_pose():
    nan = (math.nan,) * 9
    answers = [
        GREETING,
        frame(1, pose(100.0)),
        frame(2),
        frame(3, SegmentPose(1, (0.0, 0.0, 0.0), IDENTITY)),
        frame(4, SegmentPose(1, (math.nan, 1.0, 1.0), IDENTITY)),
        frame(5, pose(100.0, nan)),
        frame(6, pose(100.0, (0.0,) * 9)),
        frame(7, SegmentPose(2, (100.0, 200.0, 300.0), IDENTITY)),
        frame(8, SegmentPose(1, (1e300, 1.0, 1.0), IDENTITY)),
        encode_packet([FrameInfo(0xFFFFFFFF)]),
        frame(9, pose(101.0)),
    ]
    with scripted_server(*answers) as uri, open_pose_stream(uri) as stream:
        samples = [stream.read(PATIENCE_S) for _ in range(9)]
    assert [sample.frame for sample in samples] == list(range(2, 11))
    assert [sample.occluded for sample in samples] == [False, *[True] * 7, False]
    assert samples[0].position == (0.1, 0.2, 0.3)
    assert samples[-1].position == (0.101, 0.2, 0.3)
    for sample in samples[1:-1]:
        assert sample.position is None
        assert sample.quaternion is None


def test_latency_beyond_belief_is_not_used_and_is_counted():
    absurd = (LatencyInfo((("Camera", 1.8e35), ("Data", 0.001))),)
    two_stages = (LatencyInfo((("Camera", 0.002), ("Data", 0.001))),)
    answers = [
        GREETING,
        frame(1, pose(1.0), extra=absurd),
        frame(2, pose(2.0), extra=two_stages),
    ]
    with scripted_server(*answers) as uri, open_pose_stream(uri) as stream:
        first, second = stream.read(PATIENCE_S), stream.read(PATIENCE_S)
        assert stream.statistics().ignored_latencies == 1
    assert first.latency is None
    assert second.latency == pytest.approx(0.003)
    assert second.source_time == pytest.approx(0.02)


def test_wrong_subject_lists_what_is_offered():
    with MovingRoom(subjects=("cf1", "wand")) as room:
        uri = room.uri.replace("subject=cf1", "subject=cf2")
        with pytest.raises(UnknownSubject, match=r"no subject 'cf2'; it offers: 'cf1', 'wand'") as caught:
            open_pose_stream(uri)
    assert caught.value.offered == ("cf1", "wand")


def test_y_up_world_is_refused():
    answers = [GREETING, frame(1, pose(1.0), extra=(ApplicationInfo(1),))]
    with scripted_server(*answers) as uri, pytest.raises(SourceUnusable, match="Y-up"):
        open_pose_stream(uri)


def test_no_server_is_said_at_once():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    uri = f"vicon://127.0.0.1:{port}?subject=cf1"
    with pytest.raises(SourceLost, match="no Vicon DataStream"):
        open_pose_stream(uri, WallTime(StandingClock()))


@pytest.mark.parametrize(
    ("answers", "stay_open", "error", "says"),
    [
        ((), True, SourceLost, "does not greet"),
        ((), False, SourceLost, "closed the connection"),
        ((b"SSH-2.0-OpenSSH_9.2\r\n",), True, SourceLost, "not a Vicon DataStream"),
        ((struct.pack("<II", MAGIC, 2**31),), True, SourceLost, "over the limit"),
        ((encode_packet([FrameInfo(1)]),), True, SourceLost, "without its object list"),
        ((encode_packet([ObjectEnums((5,))]),), True, SourceUnusable, "does not offer"),
        ((GREETING,), True, PoseTimeout, "no frames with subjects"),
        ((GREETING, encode_packet([FrameInfo(1)])), True, PoseTimeout, "no frames with subjects"),
        ((GREETING, b"garbage in the stream"), True, SourceLost, "not a Vicon DataStream"),
        ((GREETING, GREETING[:-1]), False, SourceLost, "closed|reset"),
    ],
)
def test_what_is_not_a_working_server_is_known_by_the_deadline(answers, stay_open, error, says):
    with scripted_server(*answers, stay_open=stay_open) as uri, pytest.raises(error, match=says):
        open_pose_stream(uri, after_a_second())


def test_a_server_that_falls_silent_times_out_and_one_that_closes_is_lost():
    with scripted_server(GREETING, frame(1, pose(1.0))) as uri, open_pose_stream(uri) as stream:
        stream.read(PATIENCE_S)
        for _ in range(2):  # a timeout is not the end of the stream
            with pytest.raises(PoseTimeout, match="no frame"):
                stream.read(0.05)
    closing = scripted_server(GREETING, frame(1, pose(1.0)), stay_open=False)
    with closing as uri, open_pose_stream(uri) as stream:
        stream.read(PATIENCE_S)
        with pytest.raises(SourceLost, match=r"closed|lost"):
            stream.read(PATIENCE_S)
