"""A measured flight made up of columns, and what becomes of it as a record."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from calibration.flights import Flight, PoseSource
from calibration.flights.flight import finite_masks
from calibration.gap.data import prepare_flights
from calibration.gap.data.record import FlightRecord
from onboard.arrays import FloatArray

ON, OFF, END = 2.0, 17.0, 20.0
"""Motors on, motors off, end of the log (s)."""


def flight(name: str = "circle_fast_rep1", seed: int = 1, top: float = 1.0, end: float = END) -> Flight:
    """Rest on the floor, a flight with turns and noisy commands up to `top` m, rest: 100 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(100 * end)) * 0.01
    up = np.interp(t, [ON, ON + 1.0, OFF - 1.0, OFF], [0.0, 1.0, 1.0, 0.0])
    quaternion = Rotation.from_rotvec(0.2 * up[:, None] * np.sin(t[:, None] * [2.0, 3.0, 1.0])).as_quat()
    pwm = (
        np.where((t >= ON) & (t < OFF), 1.0, 0.0)[:, None] * rng.normal(35000.0, 1500.0, (t.size, 4)).round()
    )
    columns = {
        **dict(zip("xyz", (0.3 * up * np.sin(t), 0.0 * t, 0.05 + top * up), strict=True)),
        **dict(zip(("qx", "qy", "qz", "qw"), quaternion.T, strict=True)),
        **dict(zip(("gx", "gy", "gz"), rng.normal(0.0, 0.01, (3, t.size)) + up * np.sin(2 * t), strict=True)),
        **dict(zip(("ax", "ay", "az"), rng.normal([[0], [0], [9.81]], 0.05, (3, t.size)), strict=True)),
        **dict(zip(("m1", "m2", "m3", "m4"), pwm.T, strict=True)),
        "vbat": 4.1 - 0.01 * t,
    }
    data = {key: np.asarray(value, dtype=np.float64) for key, value in columns.items()}
    return Flight(
        name=name,
        source=Path(f"{name}.csv"),
        format="table",
        pose_source=PoseSource.MOCAP,
        t=t,
        data=data,
        valid=finite_masks(data),
    )


def changed(given: Flight, **columns: FloatArray) -> Flight:
    data = {**given.data, **columns}
    return replace(given, data=data, valid=finite_masks(data))


def without(given: Flight, *names: str) -> Flight:
    data = {key: value for key, value in given.data.items() if key not in names}
    return replace(given, data=data, valid=finite_masks(data))


def record_of(given: Flight) -> FlightRecord:
    prepared = prepare_flights([given])
    assert not prepared.refused, prepared.refused
    return prepared.records[0]


def reason_of(given: Flight) -> str:
    prepared = prepare_flights([given])
    assert not prepared.records
    assert prepared.refused[0].file == given.source
    return prepared.refused[0].reason


def straightened(given: Flight, start: int, length: int, names: tuple[str, ...]) -> Flight:
    """`length` samples after `start` replaced by the straight line that a lost packet leaves."""
    columns = {}
    for name in names:
        values = given.data[name].copy()
        values[start : start + length + 2] = np.linspace(
            values[start], values[start + length + 1], length + 2
        )
        columns[name] = values
    return changed(given, **columns)
