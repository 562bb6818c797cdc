"""The pose at other moments than those at which it was recorded."""

import numpy as np
from scipy.interpolate import CubicSpline

from calibration.gap.data.record import FlightRecord
from onboard.arrays import BoolArray, FloatArray


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
