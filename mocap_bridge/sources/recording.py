"""Poses of a recorded flight, at the pace at which they came: the topic ``pose`` of a run's ``series.mcap``.

What was recorded is what the judging saw: after the correction from markers to body, and before any verdict.
A record that was torn by a killed process, or cut off by a copy, is played up to where it is whole. After its
last pose the source is lost, and says whether poses are missing; who opens it again hears it from the start.
"""

import json
import math
from pathlib import Path
from typing import Any

from mocap_bridge.errors import MocapUriError, PoseTimeout, SourceLost, SourceUnusable
from mocap_bridge.pose import PoseSample, SourceStatistics
from mocap_bridge.rotation import continuous
from mocap_bridge.uri import MocapUri
from onboard.arrays import Quaternion
from onboard.closing import Closing
from onboard.record.run_record import RUN_FILE, SERIES_FILE, series_finished
from onboard.record.series_file import RunFolderError, read_series
from onboard.schema import RUN_SCHEMA, schema_problem
from onboard.timebase import Timebase

TOPIC = "pose"
_COORDINATES = ("x", "y", "z", "qx", "qy", "qz", "qw")


def open_recording(uri: MocapUri, clock: Timebase) -> "RecordedPoseStream":
    """Open the run folder, or the ``.mcap`` file in it.

    Raises:
        MocapUriError: there is no such file, or it is part of a record of another version.
        SourceUnusable: it holds no poses, or is damaged elsewhere than at its end.
    """
    path = Path(uri.path)
    file = path / SERIES_FILE if path.is_dir() else path
    if not file.is_file():
        raise MocapUriError(f"{uri}: there is no {file}; give the folder of a run")
    return RecordedPoseStream(file, uri, clock, _is_finished(file.with_name(RUN_FILE), uri))


def _is_finished(run_file: Path, uri: MocapUri) -> bool:
    """Whether ``run.json`` says that the series was finished; poses are played without it, too."""
    if not run_file.is_file():
        return False
    try:
        info = json.loads(run_file.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise MocapUriError(f"{uri}: {run_file} cannot be read ({error})") from error
    problem = schema_problem(info.get("schema") if isinstance(info, dict) else None, RUN_SCHEMA)
    if problem is not None:
        raise MocapUriError(f"{uri}: {run_file} key 'schema': {problem}")
    return series_finished(info)


class RecordedPoseStream(Closing):
    """A recording that is played (a ``PoseStream``); the first pose comes at once."""

    def __init__(self, file: Path, uri: MocapUri, clock: Timebase, finished: bool) -> None:
        self._uri, self._clock = uri, clock
        self._pause = clock.event()
        self._frames = 0
        self._last: Quaternion | None = None
        try:
            series, self._note, _ = read_series(file, TOPIC, finished)
        except (RunFolderError, OSError) as error:
            raise SourceUnusable(f"{uri}: {error}") from error
        if TOPIC not in series:
            raise SourceUnusable(f"{uri}: {file} has no poses")
        self._poses = zip(series[TOPIC].t.tolist(), series[TOPIC].messages, strict=True)
        self._next: tuple[float, dict[str, Any]] | None = next(self._poses)
        self._shift = clock() - self._next[0]

    def read(self, timeout_s: float) -> PoseSample:
        """The next pose, when its time has come; see :meth:`PoseStream.read`."""
        if self._next is None:
            missing = f"; {self._note}" if self._note else ""
            raise SourceLost(f"{self._uri}: the recording has ended{missing}")
        t, pose = self._next
        remaining = t + self._shift - self._clock()
        if remaining > timeout_s:
            self._pause.wait(timeout_s)
            raise PoseTimeout(f"{self._uri}: no pose within {timeout_s:.3g} s")
        if remaining > 0.0:
            self._pause.wait(remaining)
        self._next = next(self._poses, None)
        return self._sample(t, pose)

    def _sample(self, t: float, pose: dict[str, Any]) -> PoseSample:
        numbers = [pose.get(name) for name in _COORDINATES]
        seen = all(isinstance(value, int | float) and math.isfinite(value) for value in numbers)
        self._frames += 1
        position, quaternion = None, None
        if seen:
            x, y, z, qx, qy, qz, qw = (float(value) for value in numbers if value is not None)
            position = (x, y, z)
            quaternion = self._last = continuous((qx, qy, qz, qw), self._last)
        captured = pose.get("capture_time")
        return PoseSample(
            subject=self._uri.subject,
            frame=int(pose.get("frame") or self._frames),
            capture_time=(captured if isinstance(captured, int | float) else t) + self._shift,
            receipt_time=t + self._shift,
            position=position,
            quaternion=quaternion,
            occluded=not seen,
        )

    def statistics(self) -> SourceStatistics:
        """What was played so far."""
        return SourceStatistics(self._frames)

    def close(self) -> None:
        """Nothing is kept open: the poses were read when it was opened."""
