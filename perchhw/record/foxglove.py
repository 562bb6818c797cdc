"""A run as an MCAP file that Foxglove's 3-D, plot and log panels show as it is: ``docs/records.md``.

Messages are JSON. What is drawn has Foxglove's own types; numbers to plot have the record's topics, with the
unit in the name of each field. Time is that of the calendar.
"""

import json
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import Writer

from onboard.app_interface import LandingState
from onboard.arrays import FloatArray
from onboard.lab_file import split_subject
from onboard.record.folder import make_folder
from onboard.record.run_record import RunRecord
from onboard.record.topics import TOPICS, Topic, TopicField
from onboard.vehicle import Vehicle
from perchhw.record import palette
from perchhw.record.event_words import EventWords, Level, level_of
from perchhw.record.flown import vehicle_of
from perchhw.record.foxglove_types import ERROR, INFO, LINE_STRIP, TYPES, WARNING, json_schema
from perchhw.record.shapes import approach_of, approach_path, cage_shape, room_of, vehicle_shape
from perchhw.record.wall_time import NANOSECOND, begin_of, wall_clock

FILE = "foxglove.mcap"
WORLD = "world"
NAME = "cf1"
"""Of the drone's frame, where the address of its poses names no subject."""
_TRIGGER_RADIUS_M = 0.03
_NO_ROTATION = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
_HERE = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": _NO_ROTATION}
_LEVELS = {Level.INFO: INFO, Level.WARN: WARNING, Level.ERROR: ERROR}
_SUFFIXES = {"1": "", "text": "", "N m": "n_m", "pwm_u16": "pwm_u16"}
"""Of units that are not their own suffix: without one, or not to be made of their letters."""


class _Message(NamedTuple):
    """A message: time (s of the run's clock), topic, schema, values without their timestamp."""

    t: float
    topic: str
    schema: str
    values: dict[str, Any]


def write_foxglove(run: RunRecord, out: Path) -> Path:
    """Write ``foxglove.mcap`` into the folder `out` and give its path.

    ``/tf`` holds the drone's frame from motion capture, ``/scene/room`` and ``/scene/drone`` what is drawn,
    ``/scene/path`` the reference, ``/scene/trigger`` where it flipped, ``/mocap/pose`` and ``/estimate/pose``
    both poses, ``/log`` the events. The topics of the record come as ``/TOPIC``, with the unit in the names
    of their fields (``tau_s``); what was not measured, or is no finite number, is left out of a message.

    Raises:
        OutputFolderError: `out` cannot be written.
        RunFolderError: the record does not say when it began.
        VehicleFileError: its vehicle is not known here.
    """
    clock, vehicle = wall_clock(run), vehicle_of(run.config)
    make_folder(out)
    path = out / FILE
    channels: dict[str, int] = {}
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library="perchhw")
        for message in sorted(_messages(run, vehicle), key=lambda message: message.t):
            time_ns = clock(message.t)
            if message.topic not in channels:
                channels[message.topic] = _register(writer, message)
            data = json.dumps(_stamped(message.values, time_ns), allow_nan=False, separators=(",", ":"))
            writer.add_message(channels[message.topic], time_ns, data.encode(), publish_time=time_ns)
        writer.finish()
    return path


def _register(writer: Writer, message: _Message) -> int:
    shape = TYPES.get(message.schema)
    schema = json_schema(shape) if shape else _plot_schema(TOPICS[message.topic.removeprefix("/")])
    text = json.dumps({"title": message.schema, **schema}).encode()
    number = writer.register_schema(message.schema, SchemaEncoding.JSONSchema, text)
    return writer.register_channel(message.topic, MessageEncoding.JSON, number)


def _stamped(values: dict[str, Any], time_ns: int) -> dict[str, Any]:
    stamp = {"sec": time_ns // NANOSECOND, "nsec": time_ns % NANOSECOND}
    if "entities" in values:
        return {"entities": [{**entity, "timestamp": stamp} for entity in values["entities"]]}
    return {"timestamp": stamp, **values}


def _messages(run: RunRecord, vehicle: Vehicle) -> Iterator[_Message]:
    name = split_subject(str(run.config.get("mocap") or ""))[1] or NAME
    yield from _drawings(run, vehicle, name, begin_of(run))
    yield from _poses(run, name)
    yield from _numbers(run)
    teller = EventWords()
    for event in run.events:
        words = teller.say(event)
        if words is not None:
            values = {"level": _LEVELS[level_of(event)], "message": words, "name": "perchhw"}
            yield _Message(float(event["t"]), "/log", "foxglove.Log", values)


def _drawings(run: RunRecord, vehicle: Vehicle, name: str, begin: float) -> Iterator[_Message]:
    """What stays as it is from the beginning on, and the place of the trigger."""
    room, plan = room_of(run.config), approach_of(run.config)
    if room is not None:
        cage = cage_shape(room)
        planes = [
            _triangles(plane, cage.triangles, colour, alpha)
            for plane, colour, alpha in ((cage.floor, palette.GREY, 0.2), (cage.ceiling, palette.BLUE, 0.3))
        ]
        lines = [_line(edge, palette.GREY, 0.01) for edge in cage.edges]
        yield _scene(begin, "room", WORLD, lines=lines, triangles=planes)
    if plan is not None:
        yield _scene(begin, "path", WORLD, lines=[_line(approach_path(plan), palette.ORANGE, 0.01)])
    shape = vehicle_shape(vehicle)
    front = (palette.VERMILION, palette.GREY, palette.GREY, palette.VERMILION)
    lines = [_line(arm, palette.GREY, 0.006) for arm in shape.arms]
    lines += [_line(rim, colour, 0.003) for rim, colour in zip(shape.rims, front, strict=True)]
    lines += [_line(leg, palette.GREEN, 0.004) for leg in shape.legs]
    feet = [_sphere(foot, palette.GREEN, shape.foot_radius) for foot in shape.feet]
    yield _scene(begin, "drone", name, lines=lines, spheres=feet)
    flip = _flip_place(run)
    if flip is not None:
        yield _scene(
            flip[0], "trigger", WORLD, spheres=[_sphere(flip[1], palette.VERMILION, _TRIGGER_RADIUS_M)]
        )


def _flip_place(run: RunRecord) -> tuple[float, FloatArray] | None:
    """When the drone began to flip, s on the run's clock, and where it was then (3,); None: it did not."""
    cues, pose = run.series.get("cues"), run.series.get("pose")
    if cues is None or pose is None:
        return None
    flips = np.flatnonzero(cues.numbers("state") == LandingState.FLIP)
    places = np.column_stack([pose.numbers(axis) for axis in "xyz"])
    if not flips.size:
        return None
    t = float(cues.t[flips[0]])
    seen = np.flatnonzero((pose.t <= t) & ~np.isnan(places).any(axis=1))
    return (t, places[seen[-1]]) if seen.size else None


def _poses(run: RunRecord, name: str) -> Iterator[_Message]:
    """Occluded frames have no message; of the estimate each attitude goes with the newest position."""
    for topic in ("pose", "estimate"):
        newest: dict[str, Any] = {}
        series = run.series.get(topic)
        for t, message in zip(series.t, series.messages, strict=True) if series is not None else ():
            newest = {**newest, **message} if topic == "estimate" else message
            pose = _pose(newest)
            if pose is None or "qx" not in message:
                continue
            shown = "/mocap/pose" if topic == "pose" else "/estimate/pose"
            yield _Message(float(t), shown, "foxglove.PoseInFrame", {"frame_id": WORLD, "pose": pose})
            if topic == "pose":
                frames = {"parent_frame_id": WORLD, "child_frame_id": name}
                placed = {"translation": pose["position"], "rotation": pose["orientation"]}
                yield _Message(float(t), "/tf", "foxglove.FrameTransform", {**frames, **placed})


def _numbers(run: RunRecord) -> Iterator[_Message]:
    for topic, series in run.series.items():
        if topic not in TOPICS:
            continue  # of another version, and its units are not known
        names = {field.name: plot_name(field) for field in TOPICS[topic].fields}
        for t, message in zip(series.t, series.messages, strict=True):
            values = {names.get(key, key): value for key, value in message.items() if _can_be_shown(value)}
            yield _Message(float(t), f"/{topic}", f"perchhw.{topic}", values)


def _can_be_shown(value: Any) -> bool:
    return value is not None and not (isinstance(value, float) and not math.isfinite(value))


def plot_name(field: TopicField) -> str:
    """The name of a field with its unit: ``tau_s``, ``gx_rad_s``, ``vbat_v``."""
    unit = _SUFFIXES.get(field.unit)
    if unit is None:
        unit = field.unit.lower().replace("/", "_")
    return field.name if not unit or field.name.endswith(f"_{unit}") else f"{field.name}_{unit}"


def _plot_schema(topic: Topic) -> dict[str, Any]:
    fields = {
        plot_name(field): {
            "type": "string" if field.is_text else "number",
            "description": f"{field.meaning} [{field.unit}]",
        }
        for field in topic.fields
    }
    stamp = json_schema({"sec": "integer", "nsec": "integer"})
    return {
        "description": topic.meaning,
        "type": "object",
        "properties": {"timestamp": stamp, **fields},
    }


def _scene(t: float, what: str, frame: str, **parts: list[dict[str, Any]]) -> _Message:
    """An entity that stays until it is replaced; `frame_locked` lets it go along with its frame."""
    entity = {
        "frame_id": frame,
        "id": what,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        **{"spheres": [], "lines": [], "triangles": [], **parts},
    }
    return _Message(t, f"/scene/{what}", "foxglove.SceneUpdate", {"entities": [entity]})


def _line(points: FloatArray, colour: palette.Colour, thickness: float) -> dict[str, Any]:
    """A strip of points; `thickness` in m."""
    return {
        "type": LINE_STRIP,
        "pose": _HERE,
        "thickness": thickness,
        "scale_invariant": False,
        "points": [_vector(point) for point in points],
        "color": _rgba(colour),
        "colors": [],
        "indices": [],
    }


def _triangles(
    points: FloatArray, triangles: Iterable[tuple[int, ...]], colour: palette.Colour, alpha: float
) -> dict[str, Any]:
    """Seen from both sides: every triangle comes in both directions."""
    corners = [corner for triangle in triangles for corner in (*triangle, *reversed(triangle))]
    return {
        "pose": _HERE,
        "points": [_vector(point) for point in points],
        "color": _rgba(colour, alpha),
        "colors": [],
        "indices": corners,
    }


def _sphere(centre: FloatArray, colour: palette.Colour, radius: float) -> dict[str, Any]:
    pose = {"position": _vector(centre), "orientation": _NO_ROTATION}
    return {"pose": pose, "size": dict.fromkeys("xyz", 2.0 * radius), "color": _rgba(colour)}


def _vector(point: FloatArray) -> dict[str, float]:
    return {axis: float(value) for axis, value in zip("xyz", point, strict=True)}


def _rgba(colour: palette.Colour, alpha: float = 1.0) -> dict[str, float]:
    return {**{name: part / 255.0 for name, part in zip("rgb", colour, strict=True)}, "a": alpha}


def _pose(m: dict[str, Any]) -> dict[str, Any] | None:
    if any(m.get(key) is None for key in ("x", "y", "z", "qx", "qy", "qz", "qw")):
        return None
    return {
        "position": {axis: float(m[axis]) for axis in "xyz"},
        "orientation": {axis: float(m[f"q{axis}"]) for axis in "xyzw"},
    }
