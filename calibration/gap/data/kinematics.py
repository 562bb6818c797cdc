"""Poses along a flight: continuous, at other moments than they were recorded, and their velocity."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import savgol_filter

from calibration.gap.data.record import FlightRecord
from onboard.arrays import BoolArray, FloatArray

HALF_WIDTH_S = 0.04
"""The polynomial of a velocity is fitted over this much to either side. It looks ahead: a regressor, never a
start state."""


def continuous_quaternions(quaternions: FloatArray) -> FloatArray:
    """`quaternions`, shape (n, 4), of unit length, each with the sign that is nearest to the one before.

    A quaternion and its negative are the same attitude; a jump from one to the other is none of the vehicle.
    """
    unit = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    flips = np.sum(unit[1:] * unit[:-1], axis=1) < 0.0
    sign = np.where(np.cumsum(flips) % 2 == 0, 1.0, -1.0)
    unit[1:] *= sign[:, None]
    return unit


def differentiate(position: FloatArray, dt: float) -> FloatArray:
    """Derivative of `position`, shape (n, 3), sampled every `dt` s.

    Quadratic least squares over +-40 ms (Savitzky and Golay, 1964). With 0.2 mm of noise at 100 Hz the
    velocity has 2.6 mm/s; a jerk of 50 m/s3 biases it by 8 mm/s.
    """
    half = max(round(HALF_WIDTH_S / dt), 1)
    if position.shape[0] < 2 * half + 1:
        return np.gradient(position, dt, axis=0)
    derivative: FloatArray = savgol_filter(position, 2 * half + 1, 2, deriv=1, delta=dt, axis=0)
    return derivative


def pose_at(record: FlightRecord, t: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Position (n, 3), attitude (n, 4) and whether both are known, at times `t` (s), shape (n,).

    Cubic between samples (linear interpolation would bend the acceleration); beyond the ends the pose is
    that of the end, and not known.
    """
    inside = np.clip(t, record.t[0], record.t[-1])
    spline = CubicSpline(record.t, np.hstack([record.position, record.attitude]))
    pose = spline(inside)
    attitude = pose[:, 3:] / np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
    below = np.clip(((inside - record.t[0]) / record.dt).astype(np.int64), 0, record.t.size - 2)
    known = record.pose_known[below] & record.pose_known[below + 1] & (inside == t)
    return pose[:, :3], attitude, known
