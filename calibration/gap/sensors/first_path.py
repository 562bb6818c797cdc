"""A first path of the pose's delay along a flight, from rates alone, that no wrong start can mislead.

Tracked and measured rates, band-passed to 0.4 to 10 Hz, are compared second by second at every delay of a
grid; the path of least cost is found by dynamic programming (Viterbi, 1967), with a penalty on changes, so
that seconds in which nothing turns take the delay of their neighbours.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion
from scipy.signal import butter, sosfiltfilt

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import conjugates, products, rotation_vectors
from onboard.arrays import BoolArray, FloatArray

_BLOCK_S = 1.0
_WIDEST_S = 0.3
_BAND_HZ = (0.4, 10.0)
_CHANGE_S = 0.015  # by which the delay may change in a second
_LEVEL_S = 0.1  # by which it may be off zero
_LEAST_MISMATCH = 0.02  # rad/s, noise of both in the band


@dataclass(frozen=True)
class FirstPath:
    """Delay of the pose, roughly.

    Attributes:
        t: middles of the blocks (s), shape (b,).
        delay: s, shape (b,), positive: the pose is late.
        agreement: correlation of tracked and measured rate along that path, 0 to 1.
    """

    t: FloatArray
    delay: FloatArray
    agreement: float


def first_path(record: FlightRecord) -> FirstPath:
    """The path for one flight of some seconds."""
    good = record.flying & record.pose_known & record.inertial_known
    tracked, gyro = _rates(record, good)
    # Beyond the ends of the log nothing is known: shifted by so much, what would be compared is not there.
    edge = round(_WIDEST_S / record.dt)
    good[:edge] = good[max(record.t.size - edge, 0) :] = False
    length = round(_BLOCK_S / record.dt)
    blocks = max(record.t.size // length, 1)
    block = np.minimum(np.arange(record.t.size) // length, blocks - 1)
    shifts = np.arange(-edge, edge + 1)
    cost = np.empty((blocks, shifts.size))
    for column, shift in enumerate(shifts):
        error = np.sum((np.roll(tracked, -shift, axis=0) - gyro) ** 2, axis=1)
        cost[:, column] = np.bincount(block, weights=np.where(good, error, 0.0), minlength=blocks)
    delays = np.asarray(shifts * record.dt)
    samples = np.bincount(block, weights=good, minlength=blocks)
    # What is left at the best delay is no noise that averages out within a block: take it as the scale.
    flown = samples > 0.5 * length
    mismatch = np.median(cost[flown].min(axis=1) / samples[flown]) if flown.any() else 0.0
    scale = max(float(mismatch), _LEAST_MISMATCH**2) * 10.0
    best = _least_cost_path(np.asarray(cost / scale), delays)
    shifted = np.round(delays[best][block] / record.dt).astype(np.int64)
    index = np.clip(np.arange(record.t.size) + shifted, 0, record.t.size - 1)
    a, b = tracked[index][good], gyro[good]
    agreement = float(np.sum(a * b) / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-12))
    middles = record.t[0] + (np.arange(blocks) + 0.5) * _BLOCK_S
    return FirstPath(middles, delays[best], agreement)


def _rates(record: FlightRecord, good: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Tracked rate, over 20 ms to either side, and gyro, both in the band; rad/s, body, shape (n, 3).

    Between what is `good`, and before and after, they are drawn through: a crash would ring into the flight.
    """
    half = 2
    turns = rotation_vectors(products(conjugates(record.attitude[: -2 * half]), record.attitude[2 * half :]))
    # A turn that goes on at the end of the log does not stop there: a step would ring through the filter.
    tracked = np.pad(turns / (2 * half * record.dt), ((half, half), (0, 0)), mode="edge")
    known = binary_erosion(good, iterations=half, border_value=1)
    high = min(_BAND_HZ[1], 0.4 / record.dt)
    band = butter(3, (_BAND_HZ[0], high), "bandpass", fs=1.0 / record.dt, output="sos")
    tracked, gyro = (sosfiltfilt(band, _through(rate, known), axis=0) for rate in (tracked, record.rate))
    return tracked, gyro


def _through(values: FloatArray, known: BoolArray) -> FloatArray:
    """`values`, shape (n, 3), with straight lines between what is `known`; themselves where nothing is."""
    if not known.any():
        return values
    index = np.arange(known.size)
    return np.column_stack([np.interp(index, index[known], column[known]) for column in values.T])


def _least_cost_path(cost: FloatArray, delays: FloatArray) -> NDArray[np.int64]:
    """Index of the delay of each block that makes cost and change least together."""
    change = 0.5 * ((delays[:, None] - delays) / _CHANGE_S) ** 2
    total = cost[0] + 0.5 * (delays / _LEVEL_S) ** 2
    came_from = np.zeros(cost.shape, dtype=np.int64)
    for row in range(1, cost.shape[0]):
        step = total[:, None] + change
        came_from[row] = np.argmin(step, axis=0)
        total = np.min(step, axis=0) + cost[row]
    path = np.empty(cost.shape[0], dtype=np.int64)
    path[-1] = int(np.argmin(total))
    for row in range(cost.shape[0] - 1, 0, -1):
        path[row - 1] = came_from[row, path[row]]
    return path
