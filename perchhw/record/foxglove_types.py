"""The message types that Foxglove draws, as far as they are written here, with their JSON schemas.

Fields as documented at https://docs.foxglove.dev/docs/sdk/schemas. In JSON a time is ``{sec, nsec}`` and an
enumeration its number.
"""

from typing import Any

Shape = str | dict[str, Any] | list[Any]
"""A type: the name of a basic one, an object's fields, or a list with the type of its items."""

_TIME = {"sec": "integer", "nsec": "integer"}
_VECTOR = {"x": "number", "y": "number", "z": "number"}
_QUATERNION = {**_VECTOR, "w": "number"}
_POSE = {"position": _VECTOR, "orientation": _QUATERNION}
_COLOUR = {"r": "number", "g": "number", "b": "number", "a": "number"}
_LINE = {
    "type": "integer",
    "pose": _POSE,
    "thickness": "number",
    "scale_invariant": "boolean",
    "points": [_VECTOR],
    "color": _COLOUR,
    "colors": [_COLOUR],
    "indices": ["integer"],
}
_TRIANGLES = {
    "pose": _POSE,
    "points": [_VECTOR],
    "color": _COLOUR,
    "colors": [_COLOUR],
    "indices": ["integer"],
}
_SPHERE = {"pose": _POSE, "size": _VECTOR, "color": _COLOUR}
_ENTITY = {
    "timestamp": _TIME,
    "frame_id": "string",
    "id": "string",
    "lifetime": _TIME,
    "frame_locked": "boolean",
    "spheres": [_SPHERE],
    "lines": [_LINE],
    "triangles": [_TRIANGLES],
}

TYPES: dict[str, dict[str, Shape]] = {
    "foxglove.FrameTransform": {
        "timestamp": _TIME,
        "parent_frame_id": "string",
        "child_frame_id": "string",
        "translation": _VECTOR,
        "rotation": _QUATERNION,
    },
    "foxglove.Log": {"timestamp": _TIME, "level": "integer", "message": "string", "name": "string"},
    "foxglove.PoseInFrame": {"timestamp": _TIME, "frame_id": "string", "pose": _POSE},
    "foxglove.SceneUpdate": {"entities": [_ENTITY]},
}
"""By name: the fields that are written."""

INFO, WARNING, ERROR = 2, 3, 4
"""foxglove.Log levels."""
LINE_STRIP = 0
"""foxglove.LinePrimitive types."""


def json_schema(shape: Shape) -> dict[str, Any]:
    """The JSON schema of a type."""
    if isinstance(shape, str):
        return {"type": shape}
    if isinstance(shape, list):
        return {"type": "array", "items": json_schema(shape[0])}
    return {"type": "object", "properties": {name: json_schema(part) for name, part in shape.items()}}
