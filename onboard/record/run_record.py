"""Read a run folder of perchhw, also one whose writer was killed. Format: ``docs/records.md``.

The writer puts every message into the file at once, so what a killed process leaves is a file that ends
early: all complete messages are there, at most the last one is torn. The reader keeps every complete message
and says what it left out.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from onboard.record.checksum import checked
from onboard.record.series_file import NOT_FINITE, REMEDY, RunFolderError, Series, read_series
from onboard.schema import RUN_SCHEMA, schema_problem

RUN_FILE, SERIES_FILE, EVENTS_FILE = "run.json", "series.mcap", "events.jsonl"
_NUMBERS, _TEXTS = ("speed_m_s", "angle_deg", "ceiling_z"), ("vehicle", "legs")
"""Keys of the configuration that readers use."""
_LARGEST = 1e6

__all__ = ["RunFolderError", "RunRecord", "Series", "is_run_folder", "read_info", "series_finished"]


@dataclass(frozen=True)
class RunRecord:
    """A run as read back.

    Attributes:
        folder: the run folder.
        info: the content of ``run.json``.
        series: topics that hold at least one message, by name.
        events: lines of ``events.jsonl`` in order, each with ``t`` (s) and ``event``.
        torn: what was left out, in words; empty for a record that was closed.
        cut_off: whether its series was cut off after the record was closed: a damaged copy.
    """

    folder: Path
    info: dict[str, Any]
    series: dict[str, Series]
    events: tuple[dict[str, Any], ...]
    torn: tuple[str, ...]
    cut_off: bool = False

    @classmethod
    def read(cls, folder: str | Path) -> Self:
        """Read the run `folder`; a torn tail is left out and named in `torn`.

        Raises:
            RunFolderError: no run folder, damaged elsewhere than at the end, or not ours to read.
        """
        folder = Path(folder)
        if not is_run_folder(folder):
            raise RunFolderError(f"{folder} is not a run folder: it needs run.json and series.mcap")
        try:
            info = read_info(folder)
            finished = series_finished(info)
            content = read_series(folder / SERIES_FILE, finished=finished)
            events, torn_events = _read_events(folder / EVENTS_FILE, finished)
        except OSError as error:
            raise RunFolderError(f"{folder}: cannot be read ({error.strerror})") from error
        torn = tuple(note for note in (content.note, torn_events) if note)
        return cls(folder, info, content.series, events, torn, content.cut_off)

    @property
    def config(self) -> dict[str, Any]:
        """The configuration of the run."""
        config: dict[str, Any] = self.info["config"]
        return config

    @property
    def closed(self) -> bool:
        """Whether the writer finished the record."""
        return bool(self.info["closed"])


def is_run_folder(path: Path) -> bool:
    """Whether `path` is a run folder."""
    return (path / RUN_FILE).is_file() and (path / SERIES_FILE).is_file()


def series_finished(info: Mapping[str, Any]) -> bool:
    """Whether the writer finished ``series.mcap``, by ``run.json``: a lost record is closed without."""
    return bool(info.get("closed")) and not info.get("record_lost")


def read_info(folder: Path) -> dict[str, Any]:
    """The content of the ``run.json`` of a run.

    Raises:
        RunFolderError: not JSON, not of a run, or of another version than this program reads.
    """
    path = folder / RUN_FILE
    try:
        info = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise RunFolderError(f"{path} is not JSON ({error}): {REMEDY}") from error
    if isinstance(info, dict):
        # Before its checksum: another version may reckon that otherwise, and is damaged by nobody.
        problem = schema_problem(info["schema"], RUN_SCHEMA) if "schema" in info else None
        try:
            info = checked(info)
        except (ValueError, RecursionError) as error:
            if problem is not None:
                raise RunFolderError(f"{path} key 'schema': {problem}; {error}") from error
            raise RunFolderError(f"{path}: {error}: {REMEDY}") from error
        if problem is not None:
            raise RunFolderError(f"{path} key 'schema': {problem}")
    for key in ("config", "closed"):
        if not isinstance(info, dict) or key not in info:
            raise RunFolderError(f"{path} has no key {key!r}: not a run of perchhw")
    if "schema" not in info:
        raise RunFolderError(f"{path} key 'schema': {schema_problem(None, RUN_SCHEMA)}")
    if not isinstance(info["config"], dict):
        raise RunFolderError(f"{path} key 'config': {info['config']!r} is not an object")
    for keys, kind, word in ((_NUMBERS, int | float, "number"), (_TEXTS, str, "text")):
        for key in keys:
            value = info["config"].get(key)
            if value is not None and not isinstance(value, kind):
                raise RunFolderError(f"{path} key 'config.{key}': {value!r} is no {word}: {REMEDY}")
            if isinstance(value, int | float) and not abs(value) < _LARGEST:
                raise RunFolderError(f"{path} key 'config.{key}': {value!r} cannot be: {REMEDY}")
    return info


def _restored(values: dict[str, Any]) -> dict[str, Any]:
    """`values` with the words for infinite and NaN numbers turned back into numbers."""
    return {k: NOT_FINITE.get(v, v) if isinstance(v, str) else v for k, v in values.items()}


def _read_events(path: Path, finished: bool) -> tuple[tuple[dict[str, Any], ...], str | None]:
    if not path.is_file():
        if finished:  # without its events a landing would be judged as a flight that never triggered
            raise RunFolderError(f"{path}: missing from a record that was closed: {REMEDY}")
        return (), f"{path.name}: missing"
    lines = path.read_bytes().split(b"\n")
    tail = lines.pop()  # empty when the last line was written completely
    events = [read_event(path, number, line) for number, line in enumerate(lines, start=1)]
    torn = f"{path.name}: {len(tail)} bytes of a torn event at the end left out" if tail else None
    return tuple(events), torn


def read_event(path: Path, number: int, line: bytes) -> dict[str, Any]:
    """The event of line `number` of ``events.jsonl``.

    Raises:
        RunFolderError: damaged.
    """
    try:
        event = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise RunFolderError(f"{path} line {number}: not JSON ({error}): {REMEDY}") from error
    if not isinstance(event, dict) or "event" not in event or not isinstance(event.get("t"), int | float):
        raise RunFolderError(
            f"{path} line {number}: an event needs the keys t (a number) and event: {REMEDY}"
        )
    try:
        return _restored(checked(event))
    except (ValueError, RecursionError) as error:
        raise RunFolderError(f"{path} line {number}: {error}: {REMEDY}") from error
