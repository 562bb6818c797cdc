"""Read a run folder of perchhw, also one whose writer was killed. Format: ``docs/records.md``.

The writer puts every message into the file at once, so what a killed process leaves is a file that ends
early: all complete messages are there, at most the last one is torn. The reader keeps every complete message
and says what it left out.
"""

import json
import math
import struct
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel

from calibration.errors import CalibrationError
from onboard.arrays import FloatArray
from onboard.errors import InputError

_MAGIC = bytes((137, 77, 67, 65, 80, 48, 13, 10))
_RECORD_HEAD = struct.Struct("<BQ")  # opcode, length of the content
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel id, sequence, log time ns, publish time ns
_NOT_FINITE = {"Infinity": math.inf, "-Infinity": -math.inf, "NaN": math.nan}


class RunFolderError(CalibrationError, InputError):
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
        names = dict.fromkeys(
            k for m in self.messages for k, v in m.items() if v is None or isinstance(v, int | float)
        )
        texts = {k for m in self.messages for k, v in m.items() if isinstance(v, str)}
        return tuple(n for n in names if n not in texts)

    def numbers(self, name: str) -> FloatArray:
        """The numeric field `name`, shape (n,); NaN where a message does not have it."""
        values = (m.get(name) for m in self.messages)
        return np.array([math.nan if v is None else float(v) for v in values], dtype=np.float64)

    def texts(self, name: str) -> tuple[str | None, ...]:
        """The text field `name`; None where a message does not have it."""
        return tuple(m.get(name) for m in self.messages)


@dataclass(frozen=True)
class RunRecord:
    """A run as read back.

    Attributes:
        folder: the run folder.
        info: the content of ``run.json``.
        series: topics that hold at least one message, by name.
        events: lines of ``events.jsonl`` in order, each with ``t`` (s) and ``event``.
        torn: what was left out, in words; empty for a record that was closed.
    """

    folder: Path
    info: dict[str, Any]
    series: dict[str, Series]
    events: tuple[dict[str, Any], ...]
    torn: tuple[str, ...]

    @property
    def config(self) -> dict[str, Any]:
        """The configuration of the run."""
        config: dict[str, Any] = self.info["config"]
        return config

    @property
    def closed(self) -> bool:
        """Whether the writer finished the record."""
        return bool(self.info["closed"])

    @property
    def last_time(self) -> float | None:
        """Time of the latest message (s), or None for a record without one."""
        return max((float(s.t.max()) for s in self.series.values()), default=None)


def is_run_folder(path: Path) -> bool:
    """Whether `path` is a run folder."""
    return (path / "run.json").is_file() and (path / "series.mcap").is_file()


def read_run(folder: Path) -> RunRecord:
    """Read the run `folder`; a torn tail is left out and named in :attr:`RunRecord.torn`.

    Raises:
        RunFolderError: no run folder, or damaged elsewhere than at the end.
    """
    if not is_run_folder(folder):
        raise RunFolderError(f"{folder} is not a run folder: it needs run.json and series.mcap")
    info = read_info(folder / "run.json")
    series, torn_series = _read_series(folder / "series.mcap")
    events, torn_events = _read_events(folder / "events.jsonl")
    torn = tuple(note for note in (torn_series, torn_events) if note)
    return RunRecord(folder, info, series, events, torn)


def read_info(path: Path) -> dict[str, Any]:
    """The content of a ``run.json``.

    Raises:
        RunFolderError: not JSON, or not of a run.
    """
    try:
        info = json.loads(path.read_bytes())
    except ValueError as error:
        raise RunFolderError(f"{path} is not JSON ({error})") from error
    for key in ("config", "closed"):
        if not isinstance(info, dict) or key not in info:
            raise RunFolderError(f"{path} has no key {key!r}: not a run of perchhw")
    if not isinstance(info["config"], dict):
        raise RunFolderError(f"{path} key 'config': {info['config']!r} is not an object")
    return info


def _read_series(path: Path) -> tuple[dict[str, Series], str | None]:
    """Messages by topic, and in words what the end of the file is missing (None when it is complete)."""
    data = path.read_bytes()
    if data[: len(_MAGIC)] != _MAGIC[: len(data)]:
        raise RunFolderError(f"{path} is not an MCAP file (byte 0)")
    channels: dict[int, str] = {}
    times: dict[str, list[float]] = {}
    messages: dict[str, list[dict[str, Any]]] = {}
    position = len(_MAGIC)
    finished = False
    while not finished and position + _RECORD_HEAD.size <= len(data):
        opcode, length = _RECORD_HEAD.unpack_from(data, position)
        start = position + _RECORD_HEAD.size
        if start + length > len(data):
            break
        content = data[start : start + length]
        if opcode == Opcode.CHANNEL:
            channel = Channel.read(_stream(content))
            channels[channel.id] = channel.topic
        elif opcode == Opcode.MESSAGE:
            topic, t, values = _message(content, channels, path, position)
            times.setdefault(topic, []).append(t)
            messages.setdefault(topic, []).append(values)
        elif opcode == Opcode.CHUNK:
            raise RunFolderError(
                f"{path} byte {position}: chunked MCAP; perchhw writes and reads unchunked files"
            )
        finished = opcode == Opcode.DATA_END
        position = start + length
    series = {n: Series(n, np.array(times[n], dtype=np.float64), tuple(messages[n])) for n in times}
    if finished:
        return series, None
    lost = len(data) - min(position, len(data))
    return (
        series,
        f"{path.name}: not finished by its writer; {lost} bytes of a torn message at the end left out",
    )


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))


def _message(
    content: bytes, channels: dict[int, str], path: Path, position: int
) -> tuple[str, float, dict[str, Any]]:
    try:
        channel, _, log_time, _ = _MESSAGE_HEAD.unpack_from(content)
        topic = channels[channel]
        values = json.loads(content[_MESSAGE_HEAD.size :])
    except (struct.error, KeyError, ValueError) as error:
        raise RunFolderError(f"{path} byte {position}: damaged message ({error!r})") from error
    if not isinstance(values, dict):
        raise RunFolderError(f"{path} byte {position}: damaged message (not a JSON object)")
    return (
        topic,
        log_time / 1e9,
        {k: _NOT_FINITE.get(v, v) if isinstance(v, str) else v for k, v in values.items()},
    )


def _restored(values: dict[str, Any]) -> dict[str, Any]:
    """`values` with the words for infinite and NaN numbers turned back into numbers."""
    return {k: _NOT_FINITE.get(v, v) if isinstance(v, str) else v for k, v in values.items()}


def _read_events(path: Path) -> tuple[tuple[dict[str, Any], ...], str | None]:
    if not path.is_file():
        return (), f"{path.name}: missing"
    lines = path.read_bytes().split(b"\n")
    tail = lines.pop()  # empty when the last line was written completely
    events = []
    for number, line in enumerate(lines, start=1):
        try:
            event = json.loads(line)
        except ValueError as error:
            raise RunFolderError(f"{path} line {number}: not JSON ({error})") from error
        if not isinstance(event, dict) or "t" not in event or "event" not in event:
            raise RunFolderError(f"{path} line {number}: an event needs the keys t and event")
        events.append(_restored(event))
    torn = f"{path.name}: {len(tail)} bytes of a torn event at the end left out" if tail else None
    return tuple(events), torn
