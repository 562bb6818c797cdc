"""Measured and predicted signals of many flights, stacked: what the statistics of the gap finder work on."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.smoothing import force_from_poses
from onboard.arrays import BoolArray, FloatArray

CHANNELS = ("force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z", "voltage")
"""Specific force (m/s2) and angular acceleration (rad/s2) in the body frame, battery voltage (V)."""

PARTS = 4
"""Each flight is cut into parts, which have nuisances of their own: what drifts within a flight is no gap."""

UNITS = ("m/s2", "m/s2", "m/s2", "rad/s2", "rad/s2", "rad/s2", "V")
"""Unit of each channel."""

FORCE, TORQUE, VOLTAGE = slice(0, 3), slice(3, 6), 6

KINDS = (FORCE, TORQUE, slice(VOLTAGE, VOLTAGE + 1))
"""Channels of each kind of signal."""

SETTLING = 0.3
"""s after lost motor commands until the predicted thrust is right again: two time constants of a motor."""


_LAGS = 4.0
"""Lags of a voltage until 2 % are left of what nobody knows: the current before the first sample, or lost."""


@dataclass(frozen=True)
class Signals:
    """Signals of several flights, one below the other.

    Attributes:
        measured: shape (n, 7), see :data:`CHANNELS`; angular acceleration is the mean over the interval that
            begins at the sample.
        valid: shape (n, 7).
        bounds: first row of each flight, and the end: shape (flights + 1,).
        dt: s, sample interval.
    """

    measured: FloatArray
    valid: BoolArray
    bounds: np.ndarray
    dt: float

    @cached_property
    def flight(self) -> np.ndarray:
        """Index of the flight of each row, shape (n,)."""
        return np.repeat(np.arange(self.flights), np.diff(self.bounds))

    @cached_property
    def part_bounds(self) -> np.ndarray:
        """First row of each part of a flight, and the end, shape (PARTS flights + 1,)."""
        cuts = [
            np.linspace(first, end, PARTS + 1).round().astype(int)[:-1]
            for first, end in itertools.pairwise(self.bounds)
        ]
        return np.concatenate([*cuts, self.bounds[-1:]])

    @cached_property
    def part(self) -> np.ndarray:
        """Index of the part of each row, shape (n,)."""
        return np.repeat(np.arange(PARTS * self.flights), np.diff(self.part_bounds))

    @property
    def flights(self) -> int:
        """Number of flights."""
        return self.bounds.size - 1

    def rows(self, flight: int) -> slice:
        """The rows of one flight."""
        return slice(int(self.bounds[flight]), int(self.bounds[flight + 1]))


def window_means(values: FloatArray, window: int) -> FloatArray:
    """Means of rows, shape (n, ...), over windows of so many: shape (n // window, ...)."""
    count = values.shape[0] // window * window
    return np.asarray(values[:count].reshape(-1, window, *values.shape[1:]).mean(axis=1))


def stack_signals(records: Sequence[FlightRecord]) -> Signals:
    """What was measured on the flights, as :class:`Signals`."""
    measured = np.vstack([_measured(record) for record in records])
    valid = np.vstack([_valid(record) for record in records]) & np.isfinite(measured)
    sizes = [record.t.size for record in records]
    return Signals(
        measured=np.where(valid, measured, 0.0),
        valid=valid,
        bounds=np.concatenate([[0], np.cumsum(sizes)]),
        dt=float(np.median([record.dt for record in records])),
    )


def _measured(record: FlightRecord) -> FloatArray:
    part = np.full((record.t.size, len(CHANNELS)), np.nan)
    poses_alone = record.specific_force is None
    part[:, FORCE] = force_from_poses(record) if poses_alone else record.specific_force
    part[:-1, TORQUE] = np.diff(record.rate, axis=0) / record.dt
    if record.voltage is not None and record.voltage_measured:
        part[:, VOLTAGE] = record.voltage
    return part


def usable(record: FlightRecord) -> BoolArray:
    """Rows in flight of which commands and poses are known, and the thrusts have settled: shape (n,)."""
    return record.flying & record.pose_known & _after_loss(record.motors_known, SETTLING / record.dt)


def _valid(record: FlightRecord) -> BoolArray:
    rows = usable(record)
    valid = np.zeros((record.t.size, len(CHANNELS)), dtype=np.bool_)
    valid[:, FORCE] = (rows & record.inertial_known)[:, None]
    valid[:-1, TORQUE] = (rows & record.inertial_known)[:-1, None] & record.inertial_known[1:, None]
    valid[:, VOLTAGE] = rows & _voltage_settled(record)
    return valid


def _voltage_settled(record: FlightRecord) -> BoolArray:
    """Rows at which a voltage that follows late has forgotten the current that is not known, shape (n,)."""
    if record.voltage_lag == 0.0:
        return np.ones(record.t.size, dtype=np.bool_)
    known = record.motors_known.copy()
    known[0] = False
    return _after_loss(known, _LAGS * record.voltage_lag / record.dt)


def _after_loss(known: BoolArray, samples: float) -> BoolArray:
    """Rows that lie more than `samples` behind the last row that is not known."""
    index = np.arange(known.size)
    lost = np.maximum.accumulate(np.where(known, -np.inf, index))
    return np.asarray(index - lost > samples)
