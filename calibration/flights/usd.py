"""Flights logged on board, on the Crazyflie's micro-SD card: all channels on the drone's own clock.

The pose is the external one as it arrived (``locSrv.*``), if it was logged; else the onboard estimate
(``stateEstimate.*``). The log repeats a pose until the next one arrives: only the first of equal ones is
valid. ``gyro.*`` deg/s and ``acc.*`` g become SI.
"""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from calibration.flights.flight import (
    POSE_CHANNELS,
    Flight,
    FlightFileError,
    PoseSource,
    UnusableFlightError,
    finite_masks,
)
from calibration.flights.flight_format import FlightFormat
from calibration.flights.usd_file import MAGIC, UsdEvents, UsdLog, read_usd
from onboard.arrays import BoolArray, FloatArray
from onboard.gravity import GRAVITY

_DEGREE = math.pi / 180.0
_CHANNELS: dict[str, tuple[str, float]] = {
    **{f"gyro.{a}": (f"g{a}", _DEGREE) for a in "xyz"},
    **{f"acc.{a}": (f"a{a}", GRAVITY) for a in "xyz"},
    **{f"motor.m{i}": (f"m{i}", 1.0) for i in (1, 2, 3, 4)},
    **{f"pwm.m{i}_pwm": (f"m{i}", 1.0) for i in (1, 2, 3, 4)},  # firmware before 2020
    **{f"stateEstimate.v{a}": (f"v{a}", 1.0) for a in "xyz"},
    **{f"ctrltarget.{a}": (f"setpoint_{a}", 1.0) for a in "xyz"},
    **{f"ctrltarget.v{a}": (f"setpoint_v{a}", 1.0) for a in "xyz"},
    "pm.vbat": ("vbat", 1.0),
    "pm.vbatMV": ("vbat", 1e-3),
}
"""By variable of the log: our channel, and its unit in SI."""
_EXTERNAL = {f"locSrv.{name}": name for name in POSE_CHANNELS}
_ESTIMATE = {f"stateEstimate.{name}": name for name in POSE_CHANNELS}
_ESTIMATE_BESIDE = {f"stateEstimate.{a}": f"est_{a}" for a in "xyz"}


def is_usd(path: Path) -> bool:
    """Whether the file `path` begins like a micro-SD log."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        head = stream.read(3)
    return len(head) == 3 and head[0] == MAGIC and int.from_bytes(head[1:], "little") in (1, 2)


def load_usd(path: Path) -> Flight:
    """Read one log.

    Raises:
        FlightFileError: damaged; names the byte.
        UnusableFlightError: it holds no pose.
    """
    log = read_usd(path)
    t = np.unique(np.concatenate([events.t for events in log.events.values()] or [np.zeros(0)]))
    external = _complete(log, _EXTERNAL)
    if not external and not _complete(log, _ESTIMATE):
        raise UnusableFlightError(
            path, "no pose: log locSrv.x, y, z, qx, qy, qz, qw or the same of stateEstimate"
        )
    names = {variable: (channel, 1.0) for variable, channel in (_EXTERNAL if external else _ESTIMATE).items()}
    if external:
        names |= {variable: (channel, 1.0) for variable, channel in _ESTIMATE_BESIDE.items()}
    data, valid = _channels(path, log, t, _CHANNELS | names)
    if external:
        _reject_repeated(data, valid)
    return Flight(
        name=path.stem,
        source=path,
        format="usd",
        pose_source=PoseSource.MOCAP if external else PoseSource.ONBOARD_ESTIMATE,
        t=t,
        data=data,
        valid=valid,
        finished=log.closed,
        notes=() if log.closed else (f"log was not stopped; {log.left_out} bytes at its end left out",),
    )


FORMAT = FlightFormat(is_usd, load_usd)


def _complete(log: UsdLog, names: Mapping[str, str]) -> bool:
    """Whether one event type brings all of `names`, and one that is not the same all the time."""
    return any(
        set(names) <= set(events.values)
        and events.t.size > 1
        and any(np.ptp(events.values[name]) > 0.0 for name in names)
        for events in log.events.values()
    )


def _channels(
    path: Path, log: UsdLog, t: FloatArray, names: Mapping[str, tuple[str, float]]
) -> tuple[dict[str, FloatArray], dict[str, BoolArray]]:
    data: dict[str, FloatArray] = {}
    for event, events in log.events.items():
        rows = np.searchsorted(t, _times(path, event, events))
        for variable, values in events.values.items():
            if variable in names:
                channel, unit = names[variable]
                column = data.setdefault(channel, np.full(t.shape, np.nan))
                column[rows] = values * unit
    return data, finite_masks(data)


def _times(path: Path, name: str, events: UsdEvents) -> FloatArray:
    back = np.flatnonzero(np.diff(events.t) < 0.0)
    if back.size:
        raise FlightFileError(
            f"{path} event {name!r}: time goes back from {events.t[back[0]]:.6f} s to"
            f" {events.t[back[0] + 1]:.6f} s"
        )
    return events.t


def _reject_repeated(data: dict[str, FloatArray], valid: dict[str, BoolArray]) -> None:
    """Make poses invalid that are the one before, logged again."""
    rows = np.flatnonzero(valid["x"])
    pose = np.column_stack([data[name][rows] for name in POSE_CHANNELS])
    again = rows[1:][np.all(np.diff(pose, axis=0) == 0.0, axis=1)]
    for name in POSE_CHANNELS:
        valid[name][again] = False
