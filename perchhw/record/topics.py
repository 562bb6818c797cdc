"""The topics of a record and their fields: the schema of ``series.mcap``.

World: ENU, z up. Body: FLU. Quaternions scalar-last (x, y, z, w), body to world. A field may be left out of a
message when it was not measured; a pose that was occluded has null coordinates.
"""

from dataclasses import dataclass
from typing import Any

_TEXT = "text"


@dataclass(frozen=True)
class Field:
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
    fields: tuple[Field, ...]

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


def _fields(unit: str, meaning: str, *names: str) -> tuple[Field, ...]:
    return tuple(Field(name, unit, meaning) for name in names)


_DRONE_TIME = Field("drone_time_ms", "ms", "the drone's own time of the sample, unwrapped")

_TOPIC_LIST = (
    Topic(
        "pose",
        "pose from motion capture, as received, with the health verdict given to it",
        (
            *_fields("m", "position, world; null when occluded", "x", "y", "z"),
            *_fields("1", "attitude quaternion, body to world; null when occluded", "qx", "qy", "qz", "qw"),
            Field("frame", "1", "frame number of the source"),
            Field("verdict", _TEXT, "verdict of the pose health monitor"),
            Field("capture_time", "s", "capture time on the host's clock"),
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
            Field("tau", "s", "time to contact d_ceil / v_z"),
            Field("theta_x", "1/s", "optical flow v_x / d_ceil, positive forward"),
            Field("d_ceil", "m", "ceiling height minus height of the body's origin"),
            Field("trigger_value", "1", "value of the trigger policy; fires at >= 0"),
            Field("a_rot", "N m", "moment about b_y of the action policy; negative = nose up"),
            Field("state", "1", "state of the landing state machine (onboard.landing.LandingState)"),
            Field("reason", "1", "why the approach ended (onboard.landing.EndReason)"),
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
            Field("vbat", "V", "battery voltage"),
            Field("state", "1", "the drone's charge state (pm.state)"),
            _DRONE_TIME,
        ),
    ),
    Topic(
        "supervisor",
        "the drone's supervisor and the state of our own",
        (
            Field("bits", "1", "info bits of the drone's supervisor"),
            Field("state", _TEXT, "state of the host's flight supervisor"),
            _DRONE_TIME,
        ),
    ),
    Topic(
        "trigger",
        "snapshot taken on board when the policy fired",
        (
            Field("tick_ms", "ms", "the drone's time of the trigger"),
            Field("count", "1", "triggers since the approach was armed"),
            Field("tau", "s", "time to contact"),
            Field("theta_x", "1/s", "optical flow, positive forward"),
            Field("d_ceil", "m", "distance to the ceiling"),
            Field("trigger_value", "1", "value of the trigger policy"),
            Field("a_rot", "N m", "moment about b_y; negative = nose up"),
            *_fields("m/s", "velocity, world", "vx", "vy", "vz"),
            Field("z", "m", "height of the body's origin"),
            Field("pitch", "rad", "pitch of the body"),
        ),
    ),
)

TOPICS: dict[str, Topic] = {topic.name: topic for topic in _TOPIC_LIST}
"""All topics by name."""
