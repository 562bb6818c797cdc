"""Accelerations out of poses: one smoothing for positions and for what is held against them.

A quadratic fitted to the position over +-80 ms gives an acceleration that is a weighted mean of the true one.
The same weights applied to an accelerometer, or to the forces of a model, leave nothing but noise and misfit.
"""

import numpy as np
from scipy.ndimage import correlate1d
from scipy.signal import savgol_coeffs

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import matrices
from onboard.arrays import BoolArray, FloatArray
from onboard.gravity import GRAVITY

_HALF_WIDTH_S = 0.08


class Smoothing:
    """The two filters, which are the same but for two integrations."""

    def __init__(self, dt: float) -> None:
        self.half = max(round(_HALF_WIDTH_S / dt), 2)
        self._second = savgol_coeffs(2 * self.half + 1, 2, deriv=2, delta=dt, use="dot")
        # Summed by parts twice, weights on positions become weights on their second differences, and the
        # second difference of a position under linearly interpolated acceleration is (1, 4, 1) / 6 of it.
        twice = np.cumsum(np.cumsum(self._second))[:-2]
        self._weights = np.convolve(twice, np.array([1.0, 4.0, 1.0]) / 6.0) * dt * dt

    def second_derivative(self, values: FloatArray) -> FloatArray:
        """Of a position-like quantity, shape (n, ...); the first and last `half` rows are no use."""
        return _weighed(values, self._second)

    def mean(self, values: FloatArray) -> FloatArray:
        """Of an acceleration-like quantity, with the weights that match."""
        return _weighed(values, self._weights)

    def reach(self, known: BoolArray) -> BoolArray:
        """Where all that the filters see is known."""
        bad = np.convolve(~known, np.ones(2 * self.half + 1), mode="same") > 0.5
        bad[: self.half] = bad[-self.half :] = True
        return ~bad


def _weighed(values: FloatArray, weights: FloatArray) -> FloatArray:
    return np.asarray(correlate1d(values, weights, axis=0, mode="constant"))


def force_from_poses(record: FlightRecord) -> FloatArray:
    """Specific force (m/s2, body) by the tracked poses alone, shape (n, 3); NaN where they do not reach."""
    smoothing = Smoothing(record.dt)
    acceleration = smoothing.second_derivative(record.position)
    acceleration[:, 2] += GRAVITY
    force = np.einsum("nji,nj->ni", matrices(record.attitude), acceleration)
    force[~smoothing.reach(record.pose_known)] = np.nan
    return force


def as_poses_see(record: FlightRecord, force: FloatArray) -> FloatArray:
    """A body force, shape (n, 3), as :func:`force_from_poses` would have shown it."""
    turns = matrices(record.attitude)
    world = Smoothing(record.dt).mean(np.einsum("nij,nj->ni", turns, force))
    return np.einsum("nji,nj->ni", turns, world)
