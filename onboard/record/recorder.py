"""Write a run's record so that a killed process loses nothing that was written.

Every message and every event is one ``write`` to the operating system, without a buffer in the process:
after SIGKILL the kernel still has all of it. A thread has the kernel put it on the disk every two seconds, so
a power failure loses no more than these. ``series.mcap`` is unchunked, because a chunk lives in the process
until it is full.
"""

import json
import math
import os
import platform
import shutil
import threading
from collections.abc import Mapping
from contextlib import ExitStack
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from onboard.clock import Clock, monotonic
from onboard.errors import OnboardError, SafetyStop
from onboard.json_file import write_json_atomically
from onboard.record.checksum import with_checksum
from onboard.record.folder import make_folder, utc_now
from onboard.record.run_record import EVENTS_FILE, RUN_FILE, SERIES_FILE
from onboard.record.series_writer import SeriesWriter
from onboard.record.sync import PeriodicSync, Sync
from onboard.record.topics import TOPICS
from onboard.schema import RUN_SCHEMA

SPACE = 100_000_000
"""Bytes that must be free before a flight: ten times the record of the longest one (a minute)."""

Scalar = float | int | str | bool | None
RESERVE_FILE = ".run.json.reserve"
"""Beside an open record: the room for its last ``run.json`` on a disk that fills up in flight."""
_RESERVE_BYTES = 65_536  # several times the longest run.json
_FIELDS = {topic.name: frozenset(field.name for field in topic.fields) for topic in TOPICS.values()}
_as_json = json.JSONEncoder(separators=(",", ":"), allow_nan=False).encode


class RecordError(OnboardError):
    """The record cannot be written, or was asked to hold what its schema does not have."""


class DiskNearlyFull(RecordError, SafetyStop):
    """No flight begins whose record would fill the disk."""


def require_space(folder: Path) -> None:
    """Refuse a folder, made or not, on a disk that would be full before a flight is over.

    Raises:
        DiskNearlyFull: with the figure.
    """
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    free = shutil.disk_usage(there).free
    if free < SPACE:
        raise DiskNearlyFull(
            f"{folder}: disk_free: {free / 1e6:.0f} MB, need at least {SPACE / 1e6:.0f} MB for the record "
            "of a flight: make room, or give a folder on another disk (--out)"
        )


class _UnbufferedFile:
    """Each ``write`` reaches the operating system before it returns."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        self._position = 0

    @property
    def descriptor(self) -> int:
        """Of the open file."""
        return self._descriptor

    def write(self, data: bytes) -> None:
        """Append `data`, or nothing of it where the disk is full: what comes later must not follow a part."""
        left = len(data)
        try:
            while left:
                left -= os.write(self._descriptor, data if left == len(data) else data[-left:])
        except OSError:
            os.ftruncate(self._descriptor, self._position)
            raise
        self._position += len(data)

    def tell(self) -> int:
        return self._position

    def close(self) -> None:
        os.close(self._descriptor)


class _DiskErrors:
    """What the disk refuses within is an error of ours."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __enter__(self) -> None:
        """Nothing."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, OSError):
            raise RecordError(
                f"{self._folder}: cannot be written any more ({error.strerror}): make room on its disk"
            ) from error


class RunRecorder:
    """The one writer of a run folder. May be called from several threads.

    Args:
        folder: the run folder; created. A folder that already holds a record is refused.
        config: goes into ``run.json`` (``config``). Well-known keys that readers use when present:
            ``speed_m_s``, ``angle_deg``, ``ceiling_z``, ``vehicle``, ``legs``, ``policy_crc32``, ``seed``,
            ``drone``, ``mocap``. Must be JSON.
        clock: the monotonic clock of the flight (s).
        sync: puts a file on the disk; in a thread of its own, so that no writer waits for it.

    Raises:
        RecordError: the folder already holds a record.
        DiskNearlyFull: nothing is flown.
        OutputFolderError: it cannot be written.
    """

    def __init__(
        self, folder: Path, config: Mapping[str, Any], clock: Clock = monotonic, sync: Sync = os.fsync
    ) -> None:
        self.folder = folder
        self._clock = clock
        self._sync_file = sync
        self._lock = threading.Lock()
        self._writing = _DiskErrors(folder)
        self._closed = False
        make_folder(folder)
        require_space(folder)
        self._info: dict[str, Any] = {
            "schema": RUN_SCHEMA,
            "config": dict(config),
            "versions": _versions(),
            "started_utc": utc_now().isoformat(),
            "clock_at_start": clock(),
            "closed": False,
            "outcome": None,
        }
        try:
            self._begin()
        except FileExistsError as error:
            raise RecordError(f"{folder} already holds a record: give the run a new folder") from error
        except OSError as error:
            raise RecordError(
                f"{folder}: no record can be begun ({error.strerror}): make room, or give another folder"
            ) from error

    def _begin(self) -> None:
        self._stream = _UnbufferedFile(self.folder / SERIES_FILE)
        self._events = _UnbufferedFile(self.folder / EVENTS_FILE)
        self._write_info()
        # Not zeros: a file system that compresses would keep no room for them.
        (self.folder / RESERVE_FILE).write_bytes(os.urandom(_RESERVE_BYTES))
        schemas = {name: json.dumps(topic.json_schema()).encode() for name, topic in TOPICS.items()}
        self._writer = SeriesWriter(self._stream, schemas, ("perchhw.run", {"schema": self._info["schema"]}))
        self._sync = PeriodicSync((self._stream.descriptor, self._events.descriptor), self._sync_file)

    def _write_info(self) -> None:
        write_json_atomically(self.folder / RUN_FILE, with_checksum(self._info))

    def _write_last_info(self) -> None:
        """In the room that was kept for it, which is given back."""
        try:
            reserve = self.folder / RESERVE_FILE
            write_json_atomically(self.folder / RUN_FILE, with_checksum(self._info), reserve)
        except OSError:  # a file system that never writes in place; the reserve is gone, so there is room now
            self._write_info()

    def _finish_series(self) -> None:
        try:
            with self._writing:
                self._writer.finish()
        except RecordError as error:
            self._info["record_lost"] = self._info.get("record_lost") or str(error)
            raise

    @property
    def closed(self) -> bool:
        """Whether :meth:`close` was called."""
        return self._closed

    def write(self, topic: str, t: float, values: Mapping[str, Scalar]) -> None:
        """Append one message; on return it is with the operating system.

        Args:
            topic: a name in :data:`onboard.record.topics.TOPICS`.
            t: time on the recorder's clock (s).
            values: fields of the topic; any may be left out. Infinite and NaN numbers are kept.

        Raises:
            RecordError: unknown topic or field, or the record is closed or cannot be written.
        """
        known = _FIELDS.get(topic)
        if known is None:
            raise RecordError(f"topic {topic!r} is not in the record's schema: {', '.join(TOPICS)}")
        if not known.issuperset(values):
            unknown = ", ".join(sorted(values.keys() - known))
            raise RecordError(f"topic {topic!r} has no field {unknown}")
        data = _encode_all(values)
        time_ns = _nanoseconds(t)
        with self._lock, self._writing:
            self._require_open()
            self._writer.add(topic, time_ns, data)

    def event(self, name: str, t: float, **fields: Any) -> None:
        """Append one event (a line of ``events.jsonl``) at time `t` (s) on the recorder's clock."""
        said = {"t": t, "event": name, **{k: _encode(v) for k, v in fields.items()}}
        line = json.dumps(with_checksum(said)) + "\n"
        with self._lock, self._writing:
            self._require_open()
            self._events.write(line.encode())

    def update(self, **fields: Any) -> None:
        """Put further facts into ``run.json`` while the run goes on (for example the active policy's crc)."""
        with self._lock, self._writing:
            self._require_open()
            self._info.update(fields)
            self._write_info()

    def close(self, outcome: str | None = None, **result: Any) -> None:
        """Finish the files; `outcome` and further results go into ``run.json``. May be called twice."""
        with self._lock, self._writing, ExitStack() as rest:  # of it as much as the disk takes
            if self._closed:
                return
            self._closed = True
            ended = {"closed": True, "ended_utc": utc_now().isoformat(), "clock_at_end": self._clock()}
            self._info.update(ended, outcome=outcome, **result)
            rest.callback(self._write_last_info)
            rest.callback(self._events.close)
            rest.callback(self._stream.close)
            rest.callback(self._sync.stop)
            self._finish_series()

    def _require_open(self) -> None:
        if self._closed:
            raise RecordError(f"the record {self.folder} is closed")
        if (problem := self._sync.problem) is not None:
            raise RecordError(
                f"{self.folder}: the disk does not take the record ({problem.strerror}); what it took until "
                "now can be read; look at the disk before the next flight"
            ) from problem

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self.close(error=f"{type(error).__name__}: {error}")


def _encode_all(values: Mapping[str, Scalar]) -> bytes:
    """As JSON; only what it cannot hold is looked at one by one."""
    try:
        return _as_json(dict(values)).encode()
    except (ValueError, TypeError):  # a number that is not finite, or one of numpy
        return _as_json({k: _encode(v) for k, v in values.items()}).encode()


def _encode(value: Any) -> Any:
    """JSON has no infinity and no NaN; they travel as the words that the schema lists."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        if math.isnan(value):
            return "NaN"
        return "Infinity" if value > 0 else "-Infinity"
    return value


def _nanoseconds(t: float) -> int:
    if not math.isfinite(t) or t < 0.0:
        raise RecordError(f"time {t!r} s cannot be recorded: it must be finite and not negative")
    return round(t * 1e9)


def _versions() -> dict[str, str]:
    """Versions of what decides how a run behaves."""
    found = {"python": platform.python_version()}
    for package in ("perchhw", "cflib", "numpy", "numba", "mcap"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
