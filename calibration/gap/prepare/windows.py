"""Windows of a flight that no gap spoils."""

import numpy as np
from numpy.typing import NDArray

from calibration.gap.record import FlightRecord
from onboard.arrays import BoolArray

BEFORE_S = 0.15
"""A gap spoils what comes so shortly after it: motor lag and derivatives remember."""


def usable_samples(record: FlightRecord, before: float = BEFORE_S) -> BoolArray:
    """Samples in flight with everything known there and for `before` s before; shape (n,)."""
    bad = ~(record.flying & record.motors_known & record.pose_known & record.inertial_known)
    count = np.concatenate([[0], np.cumsum(bad)])
    reach = max(round(before / record.dt), 0)
    index = np.arange(bad.size)
    clean: BoolArray = count[index + 1] == count[np.maximum(index - reach, 0)]
    return clean & (index >= reach)


def window_starts(
    record: FlightRecord, length: float, stride: float, before: float = BEFORE_S
) -> NDArray[np.int64]:
    """First samples of windows of `length` s, `stride` s apart, that are usable from `before` s before them.

    Consecutive windows may overlap; after a spoilt stretch the next window begins as soon as one fits.
    """
    steps, stride_steps = round(length / record.dt), max(round(stride / record.dt), 1)
    usable = usable_samples(record, before)
    spoilt = np.concatenate([[0], np.cumsum(~usable)])
    last = usable.size - steps
    candidates = (
        np.flatnonzero(spoilt[steps : steps + last] == spoilt[:last]) if last > 0 else np.zeros(0, int)
    )
    starts: list[int] = []
    for start in candidates:
        if not starts or start >= starts[-1] + stride_steps:
            starts.append(int(start))
    return np.array(starts, dtype=np.int64)
