"""Flights from our own records: the channels of a run folder on one time column.

Each message becomes (part of) a row at its time; a channel is valid where a message brought it. A pose is
valid when it was not occluded and the health monitor called it ``ok`` (or gave no verdict).
"""

from pathlib import Path
from typing import Any

import numpy as np

from calibration.flights.flight import (
    POSE_CHANNELS,
    Flight,
    PoseSource,
    Trigger,
    UnusableFlightError,
    finite_masks,
)
from calibration.flights.flight_format import FlightFormat
from onboard.app_interface import LandingState
from onboard.arrays import FloatArray
from onboard.record.run_record import RunRecord, Series, is_run_folder

_TOPIC_CHANNELS: dict[str, dict[str, str]] = {
    "pose": {name: name for name in POSE_CHANNELS},
    "estimate": {"vx": "vx", "vy": "vy", "vz": "vz", "x": "est_x", "y": "est_y", "z": "est_z"},
    "rates": {"gx": "gx", "gy": "gy", "gz": "gz"},
    "acceleration": {"ax": "ax", "ay": "ay", "az": "az"},
    "cues": {
        **{name: name for name in ("tau", "theta_x", "d_ceil", "trigger_value", "a_rot")},
        "state": "landing_state",
    },
    "motors": {name: name for name in ("m1", "m2", "m3", "m4")},
    "power": {"vbat": "vbat"},
}
_DRONE_TIME = "drone_time_ms"
_TIMES = {
    "pose": ("x", "capture_time", "capture_time", 1.0),
    "rates": ("gx", _DRONE_TIME, "rates_drone_time", 1e-3),
    "acceleration": ("ax", _DRONE_TIME, "acceleration_drone_time", 1e-3),
    "motors": ("m1", _DRONE_TIME, "motors_drone_time", 1e-3),
    "cues": ("tau", _DRONE_TIME, "cues_drone_time", 1e-3),  # the landing state has messages of its own
}
"""By topic: a field that marks the messages meant, their time, our channel, and its unit in s."""
_DRONE_TIME_WRAP_MS = 1 << 24
_GOOD_VERDICTS = ("ok", None)
_SNAPSHOT = ("tau", "theta_x", "d_ceil", "trigger_value", "a_rot", "vx", "vy", "vz", "z", "pitch")


def load_run(path: Path) -> Flight:
    """Read the run folder `path`.

    Raises:
        RunFolderError: broken.
        UnusableFlightError: no message in it, or its end is missing though it was closed: whatever is judged
            of a part of a flight would be told of the whole.
    """
    run = RunRecord.read(path)
    if run.cut_off:
        raise UnusableFlightError(path, "; ".join(run.torn))
    return flight_from_run(run)


FORMAT = FlightFormat(is_run_folder, load_run)


def flight_from_run(run: RunRecord) -> Flight:
    """The flight of a record that was already read.

    Raises:
        UnusableFlightError: no message in it.
    """
    used = {topic: run.series[topic] for topic in _TOPIC_CHANNELS if topic in run.series}
    if not used:
        raise UnusableFlightError(run.folder, "the record holds no pose, estimate, rates or cues")
    t = np.unique(np.concatenate([series.t for series in used.values()]))
    data: dict[str, FloatArray] = {}
    for topic, series in used.items():
        rows = np.searchsorted(t, series.t)
        for theirs, ours in _TOPIC_CHANNELS[topic].items():
            values = series.numbers(theirs)
            if np.isnan(values).all():
                continue
            data[ours] = np.full(t.shape, np.nan)
            data[ours][rows] = values
    for topic, (field, theirs, ours, unit) in _TIMES.items():
        _add_times(used.get(topic), field, theirs, ours, unit, t, data)
    trigger = _trigger(run)
    data["triggered"] = np.zeros(t.shape) if trigger is None else (t >= trigger.t).astype(np.float64)
    valid = finite_masks(data)
    _reject_poses(used.get("pose"), t, valid)
    config = run.config
    return Flight(
        name=run.folder.name,
        source=run.folder,
        format="perchhw",
        pose_source=PoseSource.MOCAP,
        t=t,
        data=data,
        valid=valid,
        trigger=trigger,
        commanded_speed=_number(config.get("speed_m_s")),
        commanded_angle_deg=_number(config.get("angle_deg")),
        ceiling_z=_number(config.get("ceiling_z")),
        session=str(run.folder.parent),
        aborted_by=_aborted_by(run),
        finished=_finished(run),
        notes=run.torn,
    )


def _reject_poses(pose: Series | None, t: FloatArray, valid: dict[str, Any]) -> None:
    if pose is None:
        return
    verdicts = pose.texts("verdict")
    good = np.array([v is None or v.lower() in _GOOD_VERDICTS for v in verdicts], dtype=np.bool_)
    rows = np.searchsorted(t, pose.t[~good])
    for name in POSE_CHANNELS:
        if name in valid:
            valid[name][rows] = False


def _add_times(
    series: Series | None,
    field: str,
    theirs: str,
    ours: str,
    unit: float,
    t: FloatArray,
    data: dict[str, FloatArray],
) -> None:
    """The source's own time of each message that brings `field`; its row is that of the receipt."""
    if series is None or theirs not in series.fields():
        return
    seen = ~np.isnan(series.numbers(field))
    data[ours] = np.full(t.shape, np.nan)
    data[ours][np.searchsorted(t, series.t[seen])] = series.numbers(theirs)[seen] * unit


def _trigger(run: RunRecord) -> Trigger | None:
    """The first trigger snapshot with a count, else the moment when the drone began to flip.

    The snapshot arrives over the radio after the trigger; when the drone's times are known, the trigger is
    put at the drone's own time of it.
    """
    series = run.series.get("trigger")
    if series is not None:
        for t, message in zip(series.t, series.messages, strict=True):
            if message.get("count") is None or message["count"] > 0:
                snapshot = {k: float(message[k]) for k in _SNAPSHOT if message.get(k) is not None}
                return _trigger_at_tick(run, message.get("tick_ms"), float(t), snapshot)
    cues = run.series.get("cues")  # a killed writer left no snapshot: the drone's state tells
    if cues is not None:
        flips = np.flatnonzero(cues.numbers("state") == LandingState.FLIP)
        if flips.size:
            drone_ms = cues.messages[flips[0]].get(_DRONE_TIME)
            return Trigger(float(cues.t[flips[0]]), drone_time=None if drone_ms is None else drone_ms * 1e-3)
    return None


def _trigger_at_tick(
    run: RunRecord, tick_ms: float | None, receipt: float, snapshot: dict[str, float]
) -> Trigger:
    """Host time of the drone's `tick_ms`: least receipt delay over all messages that carry a drone time."""
    timed = [series for series in run.series.values() if _DRONE_TIME in series.fields()]
    if tick_ms is None or not timed:
        return Trigger(receipt, snapshot)
    host = np.concatenate([series.t for series in timed])
    drone_ms = np.concatenate([series.numbers(_DRONE_TIME) for series in timed])
    # Log packets carry 24 bits of the tick, so their unwrapped time lacks the wraps before the connection.
    last_ms = float(np.nanmax(drone_ms))
    drone_time = (last_ms - (last_ms - tick_ms) % _DRONE_TIME_WRAP_MS) * 1e-3
    offset = float(np.nanmin(host - drone_ms * 1e-3))
    return Trigger(min(receipt, drone_time + offset), snapshot, drone_time)


def _aborted_by(run: RunRecord) -> str | None:
    for key in ("aborted_by", "error"):
        if run.info.get(key) is not None:
            return str(run.info[key])
    rules = [e["aborted_by"] for e in run.events if e["event"] == "phase" and e.get("aborted_by")]
    return str(rules[0]) if rules else None


def _finished(run: RunRecord) -> bool:
    """Whether the flight came to its end: the record is closed, or the supervisor was done."""
    return run.closed or any(e["event"] == "phase" and e.get("phase") == "done" for e in run.events)


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
