"""Read ``series.mcap`` of a run: its messages by topic, or what is damaged and where.

Every record of the file is looked at, nothing is skipped: whatever is not as our writer writes it is damage,
and an error that names the byte. A file that was finished carries a CRC-32 of all its messages; files of
earlier versions have none, and neither has one whose writer was killed. Such a file ends early, with at most
one torn record, which is left out and told. A file that was finished and ends early is a damaged copy.

Format: https://mcap.dev/spec (unchunked; JSON messages).
"""

import json
import math
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from types import NoneType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Metadata, Schema

from onboard.arrays import FloatArray
from onboard.errors import InputError, OnboardError

NOT_FINITE = {"Infinity": math.inf, "-Infinity": -math.inf, "NaN": math.nan}
_MAGIC = bytes((137, 77, 67, 65, 80, 48, 13, 10))
_RECORD_HEAD = struct.Struct("<BQ")  # opcode, length of the content
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel id, sequence, log time ns, publish time ns
_RECORD_MAX = 1 << 20
"""Bytes; our longest record, a schema, has some 2000. A longer one is a damaged length, not a torn tail."""
_FOOTER_HEAD = _RECORD_HEAD.pack(Opcode.FOOTER, 20)
_FOOTER_BYTES = len(_FOOTER_HEAD) + 20
REMEDY = "fetch it again from where it was recorded, or leave this run out"


class RunFolderError(OnboardError, InputError):
    """The folder holds no record that can be read; the message names the file and the place in it."""


@dataclass(frozen=True)
class Series:
    """One topic of a record.

    Attributes:
        topic: its name.
        t: times on the run's clock (s), shape (n,), in the order of writing.
        messages: the n messages as written; infinite and NaN numbers restored.
    """

    topic: str
    t: FloatArray
    messages: tuple[dict[str, Any], ...]

    def fields(self) -> tuple[str, ...]:
        """Names of the numeric fields that occur, in order of first appearance."""
        return self._fields

    @cached_property
    def _fields(self) -> tuple[str, ...]:
        kinds = dict.fromkeys((k, type(v)) for m in self.messages for k, v in m.items())
        texts = {k for k, kind in kinds if kind is str}
        numeric = (k for k, kind in kinds if issubclass(kind, int | float | NoneType) and k not in texts)
        return tuple(dict.fromkeys(numeric))

    def numbers(self, name: str) -> FloatArray:
        """The numeric field `name`, shape (n,); NaN where a message does not have it."""
        values = [m.get(name) for m in self.messages]
        return np.array([math.nan if v is None else float(v) for v in values], dtype=np.float64)

    def texts(self, name: str) -> tuple[str | None, ...]:
        """The text field `name`; None where a message does not have it."""
        return tuple(m.get(name) for m in self.messages)


@dataclass(frozen=True)
class _Topic:
    """A channel: its name, and of each field whether it holds text."""

    name: str
    texts: dict[str, bool]


class SeriesContent(NamedTuple):
    """What a file holds: its messages by topic.

    Attributes:
        series: by topic.
        note: in words what is missing or does not matter; None when all is well.
        cut_off: whether messages at its end may be missing though its writer finished it.
    """

    series: dict[str, Series]
    note: str | None
    cut_off: bool


class _Damage(Exception):
    """What is wrong with a record; becomes a RunFolderError that also says where."""


def read_series(path: Path, topic: str | None = None, finished: bool = False) -> SeriesContent:
    """All complete messages of a file.

    Args:
        path: of the file.
        topic: whose messages alone are wanted, which takes a fraction of the time; None: all.
        finished: whether its writer finished it, as ``run.json`` says.

    Raises:
        RunFolderError: damaged elsewhere than at its end, or nothing is left of what was finished.
        OSError: cannot be read.
    """
    data = path.read_bytes()
    if finished and len(data) < len(_MAGIC):
        raise RunFolderError(f"{path} byte {len(data)}: the file ends here, and it was finished: {REMEDY}")
    file = _SeriesFile(data, topic)
    series, note = _read(path, file)
    cut_off = finished and not file.ended
    if cut_off:
        note = f"cut off at byte {len(data)} after it was closed, a damaged copy: {REMEDY}"
    return SeriesContent(series, note and f"{path.name}: {note}", cut_off)


def has_end(path: Path) -> bool:
    """Whether the file has the last bytes of one that was finished, without a look at the others.

    Raises:
        OSError: cannot be read.
    """
    with path.open("rb") as stream:
        length = stream.seek(0, os.SEEK_END)
        stream.seek(max(length - _FOOTER_BYTES - len(_MAGIC), 0))
        tail = stream.read()
    return tail.startswith(_FOOTER_HEAD) and tail.endswith(_MAGIC)


class GrowingSeries:
    """``series.mcap`` while its writer goes on: at each look the messages that came since the last.

    Args:
        path: of the file, which need not be there yet.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._data = bytearray()
        self._file = _SeriesFile(self._data)

    def read(self) -> dict[str, Series]:
        """The new messages by topic; a message that is not complete waits for the next look.

        Raises:
            RunFolderError: damaged.
            OSError: cannot be read.
        """
        if not self._path.exists():
            return {}
        with self._path.open("rb") as stream:
            stream.seek(len(self._data))
            self._data += stream.read()
        series, _ = _read(self._path, self._file)
        self._file.times, self._file.messages = {}, {}
        return series


def _read(path: Path, file: "_SeriesFile") -> tuple[dict[str, Series], str | None]:
    """What `file` finds from its position on, and its note."""
    if not file.begins_well:
        raise RunFolderError(f"{path} is not an MCAP file (byte 0): {REMEDY}")
    try:
        note = file.read()
    except _Damage as damage:
        raise RunFolderError(f"{path} byte {file.position}: {damage}; {REMEDY}") from damage
    series = {
        name: Series(name, np.array(times, dtype=np.float64), tuple(file.messages[name]))
        for name, times in file.times.items()
    }
    return series, note


class _SeriesFile:
    """One pass over the bytes of a file, which may be taken up again when there are more.

    Attributes:
        position: of the record that is looked at, or of the first that is not there any more.
        times: s, by topic. messages: by topic.
        ended: whether the end of the messages was met.
    """

    def __init__(self, data: bytes | bytearray, only: str | None = None) -> None:
        self.position = len(_MAGIC)
        self.times: dict[str, list[float]] = {}
        self.messages: dict[str, list[dict[str, Any]]] = {}
        self.ended = False
        self._data = data
        self._only = only
        self._schemas: dict[int, Schema] = {}
        self._topics: dict[int, _Topic] = {}

    @property
    def begins_well(self) -> bool:
        """Whether the first bytes, as far as they are there, are those of MCAP."""
        return self._data[: len(_MAGIC)] == _MAGIC[: len(self._data)]

    def read(self) -> str | None:
        """All messages from the position on; a note as :func:`read_series` gives it."""
        for opcode, content in self._records():
            try:
                if opcode == Opcode.DATA_END:
                    return self._end_of_data(content)
                self._take(opcode, content)
            except (McapError, struct.error, KeyError, ValueError, RecursionError) as error:
                raise _Damage(f"damaged {_name(opcode)} ({error!r})") from error
        lost = len(self._data) - min(self.position, len(self._data))
        torn = f"; {lost} bytes of a torn message at the end left out" if lost else ""
        return f"not finished by its writer{torn}"

    def _records(self) -> Iterator[tuple[int, bytes | bytearray]]:
        data = self._data
        while self.position + _RECORD_HEAD.size <= len(data):
            opcode, length = _RECORD_HEAD.unpack_from(data, self.position)
            start = self.position + _RECORD_HEAD.size
            if start + length > len(data):
                # A file that has its end cannot have a record that goes beyond it.
                if length > _RECORD_MAX or data.endswith(_MAGIC):
                    raise _Damage(f"damaged length of a {_name(opcode)} ({length} bytes)")
                return
            yield opcode, data[start : start + length]
            self.position = start + length

    def _take(self, opcode: int, content: bytes | bytearray | bytearray) -> None:
        if opcode == Opcode.MESSAGE:
            self._message(content)
        elif opcode == Opcode.CHANNEL:
            channel = _parsed(Channel, content)
            self._topics[channel.id] = _topic(channel, self._schemas[channel.schema_id])
        elif opcode == Opcode.SCHEMA:
            schema = _parsed(Schema, content)
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHUNK:
            raise _Damage("chunked MCAP; perchhw writes and reads unchunked files")
        elif opcode == Opcode.METADATA and not self.times:
            _parsed(Metadata, content)
        elif opcode != Opcode.HEADER or self.position != len(_MAGIC):
            raise _Damage(f"a {_name(opcode)} where none belongs")

    def _message(self, content: bytes | bytearray) -> None:
        channel, _, log_time, _ = _MESSAGE_HEAD.unpack_from(content)
        topic = self._topics[channel]
        if self._only not in (None, topic.name):
            return
        values = json.loads(content[_MESSAGE_HEAD.size :].decode())
        if not isinstance(values, dict):
            raise ValueError("not a JSON object")
        texts = topic.texts
        restored = {
            # Most are numbers as they stand, of which a record has a quarter of a million.
            name: value if type(value) is float and not texts[name] else _restored(value, texts[name])
            for name, value in values.items()
        }
        self.times.setdefault(topic.name, []).append(log_time / 1e9)
        self.messages.setdefault(topic.name, []).append(restored)

    def _end_of_data(self, content: bytes | bytearray) -> str | None:
        written = _parsed(DataEnd, content).data_section_crc
        if written and written != zlib.crc32(memoryview(self._data)[: self.position]):
            raise _Damage("the CRC of the messages before is wrong: one or more of them are damaged")
        self.ended = True
        return self._summary_note(self.position + _RECORD_HEAD.size + len(content))

    def _summary_note(self, start: int) -> str | None:
        """The summary after the messages is for other tools; what is wrong with it, in words."""
        data = self._data
        footer_at = len(data) - len(_MAGIC) - _FOOTER_BYTES
        whole = footer_at >= start and data.endswith(_MAGIC)
        if whole and data[footer_at : footer_at + 9] == _FOOTER_HEAD:
            footer = _parsed(Footer, data[footer_at + 9 : -len(_MAGIC)])
            begins = footer.summary_start or footer_at
            computed = zlib.crc32(memoryview(data)[begins : -len(_MAGIC) - 4])
            if begins in (start, footer_at) and footer.summary_crc in (0, computed):
                return None
        return "its summary is damaged, which other tools use; the messages are whole"


_Record = TypeVar("_Record", Schema, Channel, Metadata, DataEnd, Footer)


def _parsed(kind: type[_Record], content: bytes | bytearray) -> _Record:
    """A record by the library, which does not mind bytes that are left over."""
    stream = ReadDataStream(BytesIO(content))
    record: _Record = kind.read(stream)
    if stream.count != len(content):
        raise ValueError(f"{len(content) - stream.count} bytes too many")
    return record


def _topic(channel: Channel, schema: Schema) -> _Topic:
    """What the schema says of the channel's fields: numbers may also be words, so they have no one type."""
    if schema.name != f"perchhw.{channel.topic}":
        raise ValueError(f"topic {channel.topic!r} with the schema {schema.name!r}")
    fields = json.loads(schema.data)["properties"]
    return _Topic(channel.topic, {name: "type" in described for name, described in fields.items()})


def _restored(value: Any, is_text: bool) -> Any:
    """A value as it was before it was written: words for infinite and NaN numbers are numbers again."""
    if value is None or (is_text and isinstance(value, str)):
        return value
    if not is_text and isinstance(value, int | float) and not isinstance(value, bool):
        return value
    if not is_text and isinstance(value, str):
        return NOT_FINITE[value]
    raise ValueError(f"{value!r} is no {'text' if is_text else 'number'}")


def _name(opcode: int) -> str:
    return Opcode(opcode).name.lower() if opcode in set(Opcode) else f"record of kind {opcode}"
