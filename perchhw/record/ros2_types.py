"""ROS 2 message types as tables, and from them both what an MCAP file carries: the schema and the bytes.

A type is its fields in order, as in its ``.msg`` file; arrays are ``TYPE[]`` and ``TYPE[N]``. Schemas are of
the encoding ``ros2msg``, bytes of ``cdr`` (https://mcap.dev/spec/registry; OMG DDS-XTYPES 1.3, section 7.4.3,
plain CDR version 1, little-endian). Sources of the tables: ros2/common_interfaces, ros2/rcl_interfaces
(jazzy), and for what Crazyswarm2 publishes IMRCLab/crazyswarm2 and IMRCLab/motion_capture_tracking.
"""

import struct
from collections.abc import Mapping, Sequence
from typing import Any

Fields = tuple[tuple[str, str], ...]
Values = Mapping[str, Any]

TYPES: dict[str, Fields] = {
    "builtin_interfaces/Time": (("int32", "sec"), ("uint32", "nanosec")),
    "std_msgs/Header": (("builtin_interfaces/Time", "stamp"), ("string", "frame_id")),
    "geometry_msgs/Point": (("float64", "x"), ("float64", "y"), ("float64", "z")),
    "geometry_msgs/Vector3": (("float64", "x"), ("float64", "y"), ("float64", "z")),
    "geometry_msgs/Quaternion": (("float64", "x"), ("float64", "y"), ("float64", "z"), ("float64", "w")),
    "geometry_msgs/Pose": (("geometry_msgs/Point", "position"), ("geometry_msgs/Quaternion", "orientation")),
    "geometry_msgs/PoseStamped": (("std_msgs/Header", "header"), ("geometry_msgs/Pose", "pose")),
    "geometry_msgs/Twist": (("geometry_msgs/Vector3", "linear"), ("geometry_msgs/Vector3", "angular")),
    "geometry_msgs/PoseWithCovariance": (("geometry_msgs/Pose", "pose"), ("float64[36]", "covariance")),
    "geometry_msgs/TwistWithCovariance": (("geometry_msgs/Twist", "twist"), ("float64[36]", "covariance")),
    "geometry_msgs/Transform": (
        ("geometry_msgs/Vector3", "translation"),
        ("geometry_msgs/Quaternion", "rotation"),
    ),
    "geometry_msgs/TransformStamped": (
        ("std_msgs/Header", "header"),
        ("string", "child_frame_id"),
        ("geometry_msgs/Transform", "transform"),
    ),
    "tf2_msgs/TFMessage": (("geometry_msgs/TransformStamped[]", "transforms"),),
    "nav_msgs/Odometry": (
        ("std_msgs/Header", "header"),
        ("string", "child_frame_id"),
        ("geometry_msgs/PoseWithCovariance", "pose"),
        ("geometry_msgs/TwistWithCovariance", "twist"),
    ),
    "sensor_msgs/Imu": (
        ("std_msgs/Header", "header"),
        ("geometry_msgs/Quaternion", "orientation"),
        ("float64[9]", "orientation_covariance"),
        ("geometry_msgs/Vector3", "angular_velocity"),
        ("float64[9]", "angular_velocity_covariance"),
        ("geometry_msgs/Vector3", "linear_acceleration"),
        ("float64[9]", "linear_acceleration_covariance"),
    ),
    "rcl_interfaces/Log": (
        ("builtin_interfaces/Time", "stamp"),
        ("uint8", "level"),
        ("string", "name"),
        ("string", "msg"),
        ("string", "file"),
        ("string", "function"),
        ("uint32", "line"),
    ),
    "motion_capture_tracking_interfaces/NamedPose": (("string", "name"), ("geometry_msgs/Pose", "pose")),
    "motion_capture_tracking_interfaces/NamedPoseArray": (
        ("std_msgs/Header", "header"),
        ("motion_capture_tracking_interfaces/NamedPose[]", "poses"),
    ),
    "crazyflie_interfaces/Status": (
        ("std_msgs/Header", "header"),
        ("uint16", "supervisor_info"),
        ("float32", "battery_voltage"),
        ("uint8", "pm_state"),
        ("uint8", "rssi"),
        ("uint32", "num_rx_broadcast"),
        ("uint32", "num_tx_broadcast"),
        ("uint32", "num_rx_unicast"),
        ("uint32", "num_tx_unicast"),
        ("uint16", "latency_unicast"),
    ),
    "crazyflie_interfaces/LogDataGeneric": (
        ("std_msgs/Header", "header"),
        ("uint32", "timestamp"),
        ("float32[]", "values"),
    ),
}
"""Fields of every type that a record becomes, as (type, name)."""

_PRIMITIVES = {
    "uint8": "B", "int8": "b", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f", "float64": "d",
}  # fmt: skip
_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
_RULE = "=" * 80


def schema_name(name: str) -> str:
    """``package/msg/Type``, as ROS 2 calls it."""
    package, _, kind = name.partition("/")
    return f"{package}/msg/{kind}"


def schema_text(name: str) -> str:
    """The definition of a type, and after it those of all that it is made of."""
    parts = [_definition(name)]
    for used in _used(name):
        parts += [_RULE, f"MSG: {used}", _definition(used)]
    return "\n".join(parts)


def _definition(name: str) -> str:
    return "\n".join(f"{kind} {field}" for kind, field in TYPES[name])


def _used(name: str) -> list[str]:
    found: dict[str, None] = {}
    for kind, _ in TYPES[name]:
        element = kind.partition("[")[0]
        if element in TYPES:
            found[element] = None
            found.update(dict.fromkeys(_used(element)))
    return list(found)


def encode(name: str, values: Values) -> bytes:
    """`values` as a message of the type `name`; a field that is missing is zero, empty or the like."""
    body = bytearray()
    _put_fields(body, name, values)
    return _LITTLE_ENDIAN + bytes(body)


def _put_fields(body: bytearray, name: str, values: Values) -> None:
    for kind, field in TYPES[name]:
        _put(body, kind, values.get(field))


def _put(body: bytearray, kind: str, value: Any) -> None:
    element, bracket, length = kind.partition("[")
    if bracket:
        _put_array(body, element, length.rstrip("]"), value or ())
    elif kind in TYPES:
        _put_fields(body, kind, value or {})
    elif kind == "string":
        text = (value or "").encode()
        _put(body, "uint32", len(text) + 1)
        body += text + b"\0"
    else:
        code = _PRIMITIVES[kind]
        body += bytes(-len(body) % struct.calcsize(code))  # each number at a multiple of its size
        body += struct.pack(f"<{code}", value or 0)


def _put_array(body: bytearray, element: str, length: str, values: Sequence[Any]) -> None:
    if length:
        values = [*values, *([None] * (int(length) - len(values)))]
    else:
        _put(body, "uint32", len(values))
    for value in values:
        _put(body, element, value)
