"""Data as JSON has it, and JSON files that are replaced as a whole."""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from onboard.atomic_file import write_atomically


def as_json(value: Any) -> Any:
    """Data as JSON has it.

    Dataclasses become tables by attribute: whose attributes are named as the document has them needs no more.
    One whose document has another shape says which with ``json_shape()``, whose parts are again anything
    that is known here. Keys become text, tuples lists, enumerations their values, paths text.
    """
    if hasattr(value, "json_shape"):
        return as_json(value.json_shape())
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: as_json(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(as_json(key)): as_json(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(one) for one in value]
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Path):
        return str(value)
    return value


def parsed(text: str | bytes) -> Any:
    """What JSON says.

    Raises:
        ValueError: it is not JSON; the message has line and column. Nested deeper than can be read is no JSON
            of ours, and no ``RecursionError`` that whoever reads a file would let through.
    """
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error


def write_json_atomically(path: Path, document: Any, room: Path | None = None) -> None:
    """Write `document` (:func:`as_json`) in one step, as :func:`write_atomically` does."""
    write_atomically(path, json.dumps(as_json(document), indent=2, allow_nan=False) + "\n", room)
