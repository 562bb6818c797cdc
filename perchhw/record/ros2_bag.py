"""A run as an MCAP file with ROS 2 messages, for ``ros2 bag`` and its tools; written without ROS.

World and body axes are those of ROS (REP 103: ENU, FLU), so nothing is turned. Time is that of the calendar,
from when the run began, on the clock of the flight.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from mcap.writer import Writer

from mocap_bridge.rotation import normalised, rotate
from onboard.lab_file import split_subject
from onboard.record.folder import make_folder
from onboard.record.run_record import RunRecord
from onboard.record.topics import TOPICS
from perchhw.record.ros2_types import encode, schema_name, schema_text
from perchhw.record.wall_time import NANOSECOND, wall_clock

WORLD = "world"
NAME = "cf1"
"""Of the drone, where the address of its poses names no subject."""
_INFO, _WARNING = 20, 30
"""rcl_interfaces/Log levels."""
_UNKNOWN = (-1.0,)
"""First element of a covariance of what is not there (sensor_msgs/Imu)."""
_GENERIC = ("motors", "cues")


class _Message(NamedTuple):
    """A message: time (s of the run's clock), topic, type, values but for its header."""

    t: float
    topic: str
    kind: str
    values: dict[str, Any]


def write_ros2_bag(run: RunRecord, out: Path) -> Path:
    """Write ``ros2.mcap`` into the folder `out` and give its path.

    As Crazyswarm2 publishes them: ``/poses`` (motion capture), ``/NAME/pose`` and ``/NAME/odom`` (the drone's
    estimate), ``/NAME/status``, ``/tf``, and the topics ``motors`` and ``cues`` of the record as
    ``/NAME/TOPIC``, with their fields in the order of docs/records.md. Beside these ``/NAME/imu``, and
    ``/rosout`` with the events of the run.

    Raises:
        OutputFolderError: `out` cannot be written.
        RunFolderError: the record does not say when it began.
    """
    clock = wall_clock(run)
    make_folder(out)
    path = out / "ros2.mcap"
    name = split_subject(str(run.config.get("mocap") or ""))[1] or NAME
    channels: dict[str, int] = {}
    schemas: dict[str, int] = {}
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="perchhw")
        for message in sorted(_messages(run, name), key=lambda message: message.t):
            time_ns = clock(message.t)
            kind = message.kind
            if kind not in schemas:
                text = schema_text(kind).encode()
                schemas[kind] = writer.register_schema(schema_name(kind), "ros2msg", text)
            if message.topic not in channels:
                channels[message.topic] = writer.register_channel(message.topic, "cdr", schemas[kind])
            data = encode(kind, _stamped(message, time_ns))
            writer.add_message(channels[message.topic], time_ns, data, publish_time=time_ns)
        writer.finish()
    return path


def _stamped(message: _Message, time_ns: int) -> dict[str, Any]:
    stamp = {"sec": time_ns // NANOSECOND, "nanosec": time_ns % NANOSECOND}
    if message.kind == "tf2_msgs/TFMessage":
        header = {"header": {"stamp": stamp, "frame_id": WORLD}}
        return {"transforms": [{**transform, **header} for transform in message.values["transforms"]]}
    if message.kind == "rcl_interfaces/Log":
        return {**message.values, "stamp": stamp}
    frame = message.values.get("frame_id", WORLD)
    return {**message.values, "header": {"stamp": stamp, "frame_id": frame}}


def _messages(run: RunRecord, name: str) -> Iterator[_Message]:
    yield from _poses(run, name)
    yield from _estimates(run, name)
    yield from _inertial(run, name)
    yield from _status(run, name)
    for topic in _GENERIC:
        yield from _generic(run, name, topic)
    for event in run.events:
        words = " ".join(f"{key}={value}" for key, value in event.items() if key not in ("t", "event"))
        level = _WARNING if event.get("aborted_by") or event.get("alert") else _INFO
        values = {"level": level, "name": "perchhw", "msg": f"{event['event']} {words}".strip()}
        yield _Message(float(event["t"]), "/rosout", "rcl_interfaces/Log", values)


def _topic(run: RunRecord, name: str) -> Iterator[tuple[float, dict[str, Any]]]:
    series = run.series.get(name)
    if series is not None:
        yield from zip((float(t) for t in series.t), series.messages, strict=True)


def _poses(run: RunRecord, name: str) -> Iterator[_Message]:
    """Occluded frames have no message: ROS has no word for them."""
    for t, m in _topic(run, "pose"):
        pose = _pose(m)
        if pose is None:
            continue
        named = {"poses": [{"name": name, "pose": pose}]}
        yield _Message(t, "/poses", "motion_capture_tracking_interfaces/NamedPoseArray", named)


def _estimates(run: RunRecord, name: str) -> Iterator[_Message]:
    """Position and attitude come in log blocks of their own; each attitude goes with the newest position."""
    place: dict[str, Any] = {}
    for t, m in _topic(run, "estimate"):
        place = {**place, **m}
        pose = _pose(place)
        if "qx" not in m or pose is None:
            continue
        yield _Message(t, f"/{name}/pose", "geometry_msgs/PoseStamped", {"pose": pose})
        velocity = {axis: float(place.get(f"v{axis}") or 0.0) for axis in "xyz"}
        values = {
            "child_frame_id": name,
            "pose": {"pose": pose},
            "twist": {"twist": {"linear": _in_body(velocity, pose["orientation"])}},
        }
        yield _Message(t, f"/{name}/odom", "nav_msgs/Odometry", values)
        transform = {"translation": pose["position"], "rotation": pose["orientation"]}
        transforms = [{"child_frame_id": name, "transform": transform}]
        yield _Message(t, "/tf", "tf2_msgs/TFMessage", {"transforms": transforms})


def _inertial(run: RunRecord, name: str) -> Iterator[_Message]:
    """Rates and accelerations of one log block have one time."""
    accelerations = dict(_topic(run, "acceleration"))
    for t, m in _topic(run, "rates"):
        a = accelerations.get(t)
        if a is None:
            continue
        values = {
            "frame_id": name,
            "orientation_covariance": _UNKNOWN,
            "angular_velocity": {axis: m.get(f"g{axis}") for axis in "xyz"},
            "linear_acceleration": {axis: a.get(f"a{axis}") for axis in "xyz"},
        }
        yield _Message(t, f"/{name}/imu", "sensor_msgs/Imu", values)


def _status(run: RunRecord, name: str) -> Iterator[_Message]:
    """With each battery voltage the newest bits of the drone's supervisor; the radio is not in the record."""
    bits = ((t, int(m["bits"])) for t, m in _topic(run, "supervisor") if m.get("bits") is not None)
    following = next(bits, None)
    newest = None
    for t, m in _topic(run, "power"):
        while following is not None and following[0] <= t:
            newest, following = following[1], next(bits, None)
        if newest is None or m.get("vbat") is None:
            continue
        values = {"battery_voltage": m["vbat"], "pm_state": int(m.get("state") or 0)}
        yield _Message(
            t, f"/{name}/status", "crazyflie_interfaces/Status", {**values, "supervisor_info": newest}
        )


def _generic(run: RunRecord, name: str, topic: str) -> Iterator[_Message]:
    fields = [field.name for field in TOPICS[topic].fields if field.name != "drone_time_ms"]
    for t, m in _topic(run, topic):
        values = [m[field] for field in fields if m.get(field) is not None]
        if len(values) == len(fields):
            timestamp = int(m.get("drone_time_ms") or 0)
            message = {"timestamp": timestamp, "values": values}
            yield _Message(t, f"/{name}/{topic}", "crazyflie_interfaces/LogDataGeneric", message)


def _pose(m: dict[str, Any]) -> dict[str, dict[str, float]] | None:
    values = [m.get(key) for key in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    if any(value is None for value in values):
        return None
    x, y, z, qx, qy, qz, qw = (float(value) for value in values if value is not None)
    return {
        "position": {"x": x, "y": y, "z": z},
        "orientation": {"x": qx, "y": qy, "z": qz, "w": qw},
    }


def _in_body(velocity: dict[str, float], q: dict[str, float]) -> dict[str, float]:
    """A velocity of the world in the axes of the body, as Odometry has it (the child frame)."""
    back = (-q["x"], -q["y"], -q["z"], q["w"])
    x, y, z = rotate(normalised(back), (velocity["x"], velocity["y"], velocity["z"]))
    return {"x": x, "y": y, "z": z}
