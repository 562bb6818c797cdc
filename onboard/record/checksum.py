"""A checksum beside what JSON says of a run, so that a wrong bit in it is an error and not another number.

It is the CRC-32 of the content (keys sorted, no spaces, ASCII), not of the text: whoever writes the same
again in another layout changes nothing.
"""

import json
import zlib
from collections.abc import Mapping
from typing import Any

from onboard.json_file import as_json

KEY = "crc32"


def with_checksum(document: Mapping[str, Any]) -> dict[str, Any]:
    """`document` as JSON has it, with its checksum as the last key."""
    content: dict[str, Any] = json.loads(json.dumps(as_json(document)))
    content.pop(KEY, None)
    return {**content, KEY: _checksum(content)}


def checked(document: Mapping[str, Any]) -> dict[str, Any]:
    """What JSON said, without its checksum; one of an earlier version has none.

    Raises:
        ValueError: the checksum is another one: damaged, or changed by hand.
    """
    content = dict(document)
    said = content.pop(KEY, None)
    if said is not None and said != (found := _checksum(content)):
        raise ValueError(f"its CRC-32 is {found}, and it says {said!r}: damaged, or changed by hand")
    return content


def _checksum(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return f"{zlib.crc32(text.encode()):08x}"
