"""The topics of a record and their fields: the schema of ``series.mcap``.

World: ENU, z up. Body: FLU. Quaternions scalar-last (x, y, z, w), body to world. A field may be left out of a
message when it was not measured; a pose that was occluded has null coordinates.
"""

from dataclasses import dataclass
from typing import Any

_TEXT = "text"


@dataclass(frozen=True)
class TopicField:
    """One field of a topic: its name, unit (``text`` for words) and meaning."""

    name: str
    unit: str
    meaning: str

    @property
    def is_text(self) -> bool:
        """Whether the field holds words instead of a number."""
        return self.unit == _TEXT


@dataclass(frozen=True)
class Topic:
    """One time series of a record."""

    name: str
    meaning: str
    fields: tuple[TopicField, ...]

    def json_schema(self) -> dict[str, Any]:
        """The JSON schema that ``series.mcap`` carries for this topic."""
        number = {"anyOf": [{"type": "number"}, {"enum": ["Infinity", "-Infinity", "NaN"]}, {"type": "null"}]}
        text = {"type": ["string", "null"]}
        return {
            "title": f"perchhw.{self.name}",
            "description": self.meaning,
            "type": "object",
            "properties": {
                f.name: {**(text if f.is_text else number), "description": f"{f.meaning} [{f.unit}]"}
                for f in self.fields
            },
            "additionalProperties": False,
        }


def _fields(unit: str, meaning: str, *names: str) -> tuple[TopicField, ...]:
    return tuple(TopicField(name, unit, meaning) for name in names)


_DRONE_TIME = TopicField("drone_time_ms", "ms", "the drone's own time of the sample, unwrapped")

_TOPIC_LIST = (
    Topic(
        "pose",
        "pose from motion capture, as received, with the health verdict given to it",
        (
            *_fields("m", "position, world; null when occluded", "x", "y", "z"),
            *_fields("1", "attitude quaternion, body to world; null when occluded", "qx", "qy", "qz", "qw"),
            TopicField("frame", "1", "frame number of the source"),
            TopicField("verdict", _TEXT, "verdict of the pose health monitor"),
            TopicField("capture_time", "s", "capture time on the host's clock"),
        ),
    ),
    Topic(
        "estimate",
        "state estimated on board",
        (
            *_fields("m", "position, world", "x", "y", "z"),
            *_fields("m/s", "velocity, world", "vx", "vy", "vz"),
            *_fields("1", "attitude quaternion, body to world", "qx", "qy", "qz", "qw"),
            _DRONE_TIME,
        ),
    ),
    Topic("rates", "gyro on board", (*_fields("rad/s", "body rate", "gx", "gy", "gz"), _DRONE_TIME)),
    Topic(
        "acceleration",
        "accelerometer on board",
        (*_fields("m/s2", "specific force, body", "ax", "ay", "az"), _DRONE_TIME),
    ),
    Topic(
        "cues",
        "what the landing app sees and decides on board",
        (
            TopicField("tau", "s", "time to contact d_ceil / v_z"),
            TopicField("theta_x", "1/s", "optical flow v_x / d_ceil, positive forward"),
            TopicField("d_ceil", "m", "ceiling height minus height of the body's origin"),
            TopicField("trigger_value", "1", "value of the trigger policy; fires at >= 0"),
            TopicField("a_rot", "N m", "moment about b_y of the action policy; negative = nose up"),
            TopicField("state", "1", "state of the landing state machine (onboard.landing.LandingState)"),
            TopicField("reason", "1", "why the approach ended (onboard.landing.EndReason)"),
            _DRONE_TIME,
        ),
    ),
    Topic(
        "motors",
        "commands to the motors",
        (*_fields("pwm_u16", "command", "m1", "m2", "m3", "m4"), _DRONE_TIME),
    ),
    Topic(
        "power",
        "battery",
        (
            TopicField("vbat", "V", "battery voltage"),
            TopicField("state", "1", "the drone's charge state (pm.state)"),
            _DRONE_TIME,
        ),
    ),
    Topic(
        "supervisor",
        "the drone's supervisor and the state of our own",
        (
            TopicField("bits", "1", "info bits of the drone's supervisor"),
            TopicField("state", _TEXT, "state of the host's flight supervisor"),
            _DRONE_TIME,
        ),
    ),
    Topic(
        "trigger",
        "snapshot taken on board when the policy fired",
        (
            TopicField("tick_ms", "ms", "the drone's time of the trigger"),
            TopicField("count", "1", "triggers since the approach was armed"),
            TopicField("tau", "s", "time to contact"),
            TopicField("theta_x", "1/s", "optical flow, positive forward"),
            TopicField("d_ceil", "m", "distance to the ceiling"),
            TopicField("trigger_value", "1", "value of the trigger policy"),
            TopicField("a_rot", "N m", "moment about b_y; negative = nose up"),
            *_fields("m/s", "velocity, world", "vx", "vy", "vz"),
            TopicField("z", "m", "height of the body's origin"),
            TopicField("pitch", "rad", "pitch of the body"),
        ),
    ),
)

TOPICS: dict[str, Topic] = {topic.name: topic for topic in _TOPIC_LIST}
"""All topics by name."""
