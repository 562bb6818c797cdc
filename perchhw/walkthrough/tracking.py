"""How well a drone followed its test flights: distance between course and motion capture."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from onboard.manoeuvres import Course, manoeuvre
from onboard.record.run_record import RunRecord
from onboard.room import RoomGeometry
from perchhw.errors import FlightStackError
from perchhw.record.run import read_run

_BEGIN, _END = "FlyCourse()", "Land("


class NoCourse(FlightStackError):
    """A record without a whole test flight."""


def tracking_errors(attempts: Path) -> dict[str, float]:
    """RMS distance (m) from the course by kind of test flight; the mean over flights of one kind.

    Args:
        attempts: folder of the records of a campaign of test flights.

    Raises:
        NoCourse: no record in it holds a whole test flight.
    """
    by_kind: dict[str, list[float]] = {}
    for folder in sorted(path for path in attempts.iterdir() if path.is_dir()):
        record = read_run(folder)
        config = record.info["config"]
        if record.info.get("aborted_by") is None and "flight" in config:
            by_kind.setdefault(config["flight"], []).append(tracking_error(record))
    if not by_kind:
        raise NoCourse(f"{attempts}: no test flight that came to its end; fly the campaign again")
    return {kind: math.fsum(errors) / len(errors) for kind, errors in by_kind.items()}


def tracking_error(record: RunRecord) -> float:
    """RMS distance (m) between the poses of a test flight and its course, at the time each was captured."""
    course = _course(record)
    begin = _command_time(record, _BEGIN)
    end = min(_command_time(record, _END), begin + course.duration)
    poses = record.series["pose"]
    captured = poses.numbers("capture_time")
    position = np.column_stack([poses.numbers(axis) for axis in "xyz"])
    seen = (captured >= begin) & (captured <= end) & np.isfinite(position).all(axis=1)
    if not seen.any():
        raise NoCourse(f"{record.folder}: no poses during the test flight")
    wanted = np.array([course.position[course.index_at(t - begin)] for t in captured[seen]])
    return float(np.sqrt(np.mean(np.sum((position[seen] - wanted) ** 2, axis=1))))


def _course(record: RunRecord) -> Course:
    config: dict[str, Any] = record.info["config"]
    kind, parameters = config["flight"], config["parameters"]
    return manoeuvre(kind).course(parameters, RoomGeometry(ceiling_z=config["ceiling_z"]))


def _command_time(record: RunRecord, command: str) -> float:
    """s on the run's clock at which a command was given."""
    for event in record.events:
        if event["event"] == "command" and str(event["command"]).startswith(command):
            return float(event["t"])
    raise NoCourse(f"{record.folder}: was never told {command}")
