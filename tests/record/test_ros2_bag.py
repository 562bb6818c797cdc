"""A run as a ROS 2 bag, read back by mcap-ros2-support, which parses the schemas and the bytes by itself."""

import importlib.util
import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Schema

from perchhw.cli.main import run as perchhw
from perchhw.record import RunRecorder
from perchhw.record.ros2_types import TYPES, encode, schema_name, schema_text

needs_reader = pytest.mark.skipif(
    importlib.util.find_spec("mcap_ros2") is None,
    reason="mcap-ros2-support is not installed: pip install mcap-ros2-support",
)
START = 50.0


def record(folder: Path) -> Path:
    config = {"mocap": "vicon://127.0.0.1:801?subject=cf7", "drone": "udp://127.0.0.1:19850"}
    half = math.sqrt(0.5)
    with RunRecorder(folder, config, clock=lambda: START) as recorder:
        recorder.event("phase", START, phase="checking", aborted_by=None)
        for i in range(20):
            t, ms = START + 0.01 * i, {"drone_time_ms": 1000 + 10 * i}
            turned = {"qx": 0.0, "qy": 0.0, "qz": half, "qw": half}
            at = {"x": None, "y": None, "z": None} if i == 5 else {"x": 0.1 * i, "y": 2.0, "z": 0.5}
            recorder.write("pose", t, {**at, **turned, "frame": i, "verdict": "OK", "capture_time": t})
            recorder.write(
                "estimate", t, {"x": 0.1 * i, "y": 2.0, "z": 0.5, "vx": 1.0, "vy": 0.0, "vz": 0.25, **ms}
            )
            recorder.write("estimate", t + 0.001, {**turned, **ms})
            recorder.write("rates", t, {"gx": 0.1, "gy": -0.2, "gz": 0.3, **ms})
            recorder.write("acceleration", t, {"ax": 0.0, "ay": 0.5, "az": 9.8, **ms})
            recorder.write("supervisor", t, {"bits": 0b1011, **ms})
            recorder.write("power", t, {"vbat": 3.9, "state": 0, **ms})
            recorder.write("motors", t, {"m1": 1.0, "m2": 2.0, "m3": 3.0, "m4": 65535.0, **ms})
        recorder.event("phase", START + 0.2, phase="landing", aborted_by="pose lost")
    return folder


def read(path: Path) -> dict[str, list[tuple[int, Any]]]:
    from mcap_ros2.decoder import DecoderFactory

    found: dict[str, list[tuple[int, Any]]] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, decoded))
    return found


@needs_reader
def test_a_stranger_reads_what_was_recorded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = record(tmp_path / "run")
    assert perchhw(["--json", "log", "export", str(folder), "--to", "ros2"]) == 0
    (file,) = json.loads(capsys.readouterr().out)["files"]
    topics = read(Path(file))
    assert set(topics) == {
        *("/poses", "/tf", "/rosout", "/cf7/pose", "/cf7/odom", "/cf7/imu", "/cf7/status", "/cf7/motors"),
    }
    assert len(topics["/poses"]) == 19
    (named,) = topics["/poses"][0][1].poses
    assert (named.name, named.pose.position.y) == ("cf7", 2.0)
    assert topics["/poses"][0][1].header.frame_id == "world"

    log_time, odom = topics["/cf7/odom"][-1]
    assert odom.pose.pose.position.x == pytest.approx(1.9)
    assert odom.child_frame_id == "cf7"
    # Facing along y, a velocity along the world's x is one to the right.
    linear = odom.twist.twist.linear
    assert (linear.x, linear.y, linear.z) == pytest.approx((0.0, -1.0, 0.25), abs=1e-12)
    assert odom.header.stamp.sec * 1_000_000_000 + odom.header.stamp.nanosec == log_time
    begin = json.loads((folder / "run.json").read_text())["started_utc"]
    assert log_time == pytest.approx(1e9 * (_unix(begin) + 0.191), abs=2e3)

    imu = topics["/cf7/imu"][0][1]
    assert (imu.angular_velocity.y, imu.linear_acceleration.z) == (-0.2, 9.8)
    assert imu.orientation_covariance[0] == -1.0
    state = topics["/cf7/status"][0][1]
    assert (state.supervisor_info, state.pm_state) == (0b1011, 0)
    assert state.battery_voltage == pytest.approx(3.9)
    motors = topics["/cf7/motors"][3][1]
    assert (motors.timestamp, list(motors.values)) == (1030, [1.0, 2.0, 3.0, 65535.0])
    transform = topics["/tf"][0][1].transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("world", "cf7")
    words = [(log.level, log.msg) for _, log in topics["/rosout"]]
    assert words[0] == (20, "phase phase=checking aborted_by=None")
    assert words[1][0] == 30
    times = [log_time for messages in topics.values() for log_time, _ in messages]
    assert all(isinstance(t, int) for t in times)


def decode(name: str, data: bytes) -> Any:
    from mcap_ros2.decoder import DecoderFactory

    schema = Schema(1, schema_text(name).encode(), "ros2msg", schema_name(name))
    decoder = DecoderFactory().decoder_for("cdr", schema)
    assert decoder is not None
    return decoder(data)


def _unix(text: str) -> float:
    from datetime import datetime

    return datetime.fromisoformat(text).timestamp()


@needs_reader
@pytest.mark.parametrize("name", TYPES)
def test_every_type_is_read_back_by_its_own_schema(name: str) -> None:
    written = example(name, 1)
    decoded = decode(name, encode(name, written))
    assert same(decoded, name, written)


@needs_reader
@given(st.lists(st.tuples(st.text(max_size=30), st.floats(allow_nan=False)), max_size=5))
def test_strings_and_sequences_of_any_length_keep_everything_aligned(poses: list[tuple[str, float]]) -> None:
    name = "motion_capture_tracking_interfaces/NamedPoseArray"
    poses = [(text.replace("\0", ""), x) for text, x in poses]
    values = {
        "header": {"frame_id": "w"},
        "poses": [{"name": text, "pose": {"position": {"x": x}}} for text, x in poses],
    }
    decoded = decode(name, encode(name, values))
    assert [(pose.name, pose.pose.position.x) for pose in decoded.poses] == poses


def example(name: str, seed: int) -> dict[str, Any]:
    return {field: value_of(kind, seed + i) for i, (kind, field) in enumerate(TYPES[name])}


def value_of(kind: str, seed: int) -> Any:
    element, bracket, length = kind.partition("[")
    if bracket:
        return [value_of(element, seed + i) for i in range(int(length.rstrip("]") or 3))]
    if kind in TYPES:
        return example(kind, seed + 1)
    return f"text {seed}" if kind == "string" else seed


def same(decoded: Any, name: str, written: dict[str, Any]) -> bool:
    return all(equal(getattr(decoded, field), kind, written[field]) for kind, field in TYPES[name])


def equal(got: Any, kind: str, written: Any) -> bool:
    element, bracket, _ = kind.partition("[")
    if bracket:
        return len(got) == len(written) and all(
            equal(g, element, w) for g, w in zip(got, written, strict=True)
        )
    return same(got, kind, written) if kind in TYPES else got == written
