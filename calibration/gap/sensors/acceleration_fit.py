"""Tracked position against the accelerometer, both seen through one and the same smoothing.

A quadratic fitted to the position over +-80 ms gives an acceleration that is a weighted mean of the true one.
The same weights applied to the accelerometer leave nothing but noise and what is sought:

    D[p] + g z - K[A a] = D[A] o - K[A] b + K[A [a]x] dr

D: second derivative of the quadratic; K: its weights on the acceleration; A: attitude; a: specific force;
o: tracked origin from the accelerometer; b: bias of the accelerometer; dr: what the turn of the tracked frame
is more than assumed. Upright and unaccelerated, b and dr are one and the same (a tilt of 1 mrad looks like
0.01 m/s2): only turns that the gyro saw, and changes of thrust, tell them apart.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import cross_matrices, matrices
from calibration.gap.data.smoothing import Smoothing
from calibration.gap.sensors.attitude_fit import AttitudeFit
from calibration.gap.sensors.knots import hats
from onboard.arrays import FloatArray
from onboard.gravity import GRAVITY

_OFFSET_PRIOR_M = 0.3
_BIAS_PRIOR = 1.0  # m/s2
_BLOCK_S = 0.5


@dataclass(frozen=True)
class AccelerationFit:
    """What tracked position and accelerometer of one flight say of each other.

    Attributes:
        offset, offset_covariance: m, body, of the tracked origin from the accelerometer; (3,) and (3, 3).
        bias: m/s2, of the accelerometer.
        rotation, rotation_covariance: rad, of the tracked frame, from attitude and acceleration together.
    """

    offset: FloatArray
    offset_covariance: FloatArray
    bias: FloatArray
    rotation: FloatArray
    rotation_covariance: FloatArray


def fit_acceleration(
    record: FlightRecord, attitude: AttitudeFit, rotation: FloatArray, rotation_covariance: FloatArray
) -> AccelerationFit | None:
    """Fit one flight; None without accelerometer or without enough flight.

    Args:
        rotation, rotation_covariance: what is known of the turn of the tracked frame, rad, (3,) and (3, 3).
    """
    if record.specific_force is None:
        return None
    smoothing = Smoothing(record.dt)
    # The pose is differentiated by its own clock, and then taken at the times of the accelerometer.
    at = record.t + hats(record.t, attitude.knots) @ attitude.path
    tracked = CubicSpline(record.t, smoothing.second_derivative(record.position))(
        np.clip(at, record.t[0], record.t[-1])
    )
    seen = np.interp(at, record.t, smoothing.reach(record.pose_known), left=0.0, right=0.0) > 0.999
    rows = smoothing.reach(record.flying & record.inertial_known) & seen
    if np.count_nonzero(rows) < 10 * (2 * smoothing.half + 1):
        return None
    frames = matrices(attitude.attitude)
    felt = np.einsum("nij,nj->ni", frames, record.specific_force)
    target = tracked - smoothing.mean(felt)
    target[:, 2] += GRAVITY
    columns = np.concatenate(
        [
            smoothing.second_derivative(frames),
            -smoothing.mean(frames),
            smoothing.mean(frames @ cross_matrices(record.specific_force)),
        ],
        axis=2,
    )
    block = np.floor((record.t[rows] - record.t[0]) / _BLOCK_S).astype(np.int64)
    precision = np.zeros((9, 9))
    precision[:3, :3] = np.eye(3) / _OFFSET_PRIOR_M**2
    precision[3:6, 3:6] = np.eye(3) / _BIAS_PRIOR**2
    precision[6:, 6:] = np.linalg.inv(rotation_covariance)
    pull = precision @ np.concatenate([np.zeros(6), rotation - attitude.rotation])
    value, covariance = _least_squares(columns[rows], target[rows], block, precision, pull, smoothing.half)
    return AccelerationFit(
        offset=value[:3],
        offset_covariance=covariance[:3, :3],
        bias=value[3:6],
        rotation=attitude.rotation + value[6:],
        rotation_covariance=covariance[6:, 6:],
    )


def _least_squares(
    columns: FloatArray,
    target: FloatArray,
    block: FloatArray,
    precision: FloatArray,
    pull: FloatArray,
    correlated: int,
) -> tuple[FloatArray, FloatArray]:
    """Values and covariance, shape (m,) and (m, m), with a prior; errors from the scatter between blocks.

    Neighbouring rows share noise: the weight of the data against the prior counts `correlated` rows as one.
    """
    normal = np.einsum("nki,nkj->ij", columns, columns)
    right = np.einsum("nki,nk->i", columns, target)
    value = np.linalg.lstsq(normal, right, rcond=1e-9)[0]
    variance = float(np.mean((target - columns @ value) ** 2)) * correlated
    bread = np.linalg.inv(normal / variance + precision)
    value = bread @ (right / variance + pull)
    scores = np.einsum("nki,nk->ni", columns, target - columns @ value) / variance
    _, index = np.unique(block, return_inverse=True)
    sums = np.zeros((index.max() + 1, value.size))
    np.add.at(sums, index, scores)
    return value, bread @ (sums.T @ sums + precision) @ bread
