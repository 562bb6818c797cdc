"""How far motion capture and inertial sensors disagree about a record: what sensing effects are judged by."""

import numpy as np

from calibration.gap.data.record import FlightRecord
from calibration.gap.data.rotations import conjugates, integrate_rate, matrices, products, rotation_vectors
from calibration.gap.sensors.acceleration_fit import Smoothing
from onboard.gravity import GRAVITY

SPAN_S = 0.5
"""Turns are compared over this time."""


def turn_mismatch(record: FlightRecord) -> tuple[float, int]:
    """Sum of squares (rad^2) and number of the differences between tracked and gyro turns over 0.5 s."""
    steps = round(SPAN_S / record.dt)
    gyro = integrate_rate(record.rate, record.dt)
    felt = products(conjugates(gyro[:-steps]), gyro[steps:])
    seen = products(conjugates(record.attitude[:-steps]), record.attitude[steps:])
    error = rotation_vectors(products(conjugates(felt), seen))
    good = record.flying & record.pose_known & record.inertial_known
    lost = np.concatenate([[0], np.cumsum(~good)])
    rows = lost[steps + 1 :] == lost[: -steps - 1]
    return float(np.sum(error[rows] ** 2)), int(np.count_nonzero(rows))


def acceleration_mismatch(record: FlightRecord) -> tuple[float, int]:
    """Sum of squares (m^2/s^4) and number of the differences between tracked and felt acceleration.

    Both over about 80 ms; less the bias of the accelerometer that fits the flight best.
    """
    if record.specific_force is None:
        return 0.0, 0
    smoothing = Smoothing(record.dt)
    rows = smoothing.reach(record.flying & record.pose_known & record.inertial_known)
    frames = matrices(record.attitude)
    felt = np.einsum("nij,nj->ni", frames, record.specific_force)
    error = smoothing.second_derivative(record.position) - smoothing.mean(felt)
    error[:, 2] += GRAVITY
    columns = smoothing.mean(frames)[rows].reshape(-1, 3)
    target = error[rows].ravel()
    if target.size < 3:
        return 0.0, 0
    bias = np.linalg.lstsq(columns, target, rcond=None)[0]
    return float(np.sum((target - columns @ bias) ** 2)), int(np.count_nonzero(rows))
