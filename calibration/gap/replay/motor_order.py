"""Whether a log numbers its motors as the vehicle file does, and its rotors turn as they should: how do its
columns turn the body?"""

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from calibration.errors import CalibrationError
from calibration.gap.data.record import FlightRecord
from calibration.gap.data.signals import usable
from calibration.gap.replay.inputs import below_no_ceiling
from calibration.gap.replay.teacher_forcing import teacher_forced
from onboard.arrays import FloatArray
from onboard.errors import InputError
from onboard.mixer import PITCH, ROLL, YAW
from onboard.vehicle import Vehicle

_BLOCK = 0.05
"""s over which rates and thrusts are averaged: long against the noise of a gyro, short against a turn."""

_LEAN, _YAW = slice(0, 2), slice(2, 3)
"""Axes that tell an order, and the one that tells in which direction rotors turn."""

_CLEAR, _BETTER = 0.7, 0.25
"""Mean correlation of moments with the angular accelerations from which on another order (or, negative,
another direction) is told, and by which an order must beat the file's: what delays, lags and weak motors do
to a correlation is far less."""


class MotorOrderError(CalibrationError, InputError):
    """The motors of a log are numbered otherwise; the message says how."""


def check_motor_order(records: Sequence[FlightRecord], vehicle: Vehicle) -> None:
    """Refuse flights that turn as their motor commands would have them in another order, or with rotors that
    turn the other way.

    Raises:
        MotorOrderError: they do.
    """
    thrust, turn = _moved(records, vehicle)
    scores = {order: _correlation(thrust[:, order], turn, _LEAN) for order in permutations(range(4))}
    own = scores.pop((0, 1, 2, 3))
    order = max(scores, key=lambda one: scores[one])
    if scores[order] < _CLEAR or scores[order] - own < _BETTER:
        _check_rotors(_correlation(thrust, turn, _YAW))
        return
    columns = ", ".join(f"M{motor} is in m{column + 1}" for motor, column in enumerate(order, 1))
    raise MotorOrderError(
        "the body turns as if the motors were logged in another order than M1 front right, M2 back right, "
        f"M3 back left, M4 front left: {columns}. Put the columns in that order (docs/gap_data.md)"
    )


def _check_rotors(yaws: float) -> None:
    """Refuse a body that yaws against its rotors.

    Raises:
        MotorOrderError: it does.
    """
    if yaws > -_CLEAR:
        return
    raise MotorOrderError(
        "the body yaws against its motor commands: its rotors turn the other way than M1 and M3 "
        "counter-clockwise seen from above. Turn the body's frame by a quarter, so that x is what y was and "
        "y what -x was: m1 to m4 are what m4, m1, m2, m3 were, gx and gy what gy and -gx, ax and ay what ay "
        "and -ax, and qx, qy, qz, qw what 0.7071 times qx+qy, qy-qx, qz+qw, qw-qz were; inertia_xx and "
        "inertia_yy, arm_x and arm_y of the vehicle file change places (docs/gap_data.md)"
    )


def _moved(records: Sequence[FlightRecord], vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Thrusts and angular accelerations of all flights, as :func:`_blocks` has them."""
    parameters = below_no_ceiling(vehicle)
    pairs = [_blocks(record, teacher_forced(record, parameters).thrust) for record in records]
    thrust, turn = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return thrust, turn


def _blocks(record: FlightRecord, thrust: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Thrusts (N, (b, 4)), angular accelerations (rad/s2, (b, 3)): means over blocks, less the flight's."""
    length = max(1, round(_BLOCK / record.dt))
    count = (record.t.size - 1) // length
    rows = (usable(record) & record.inertial_known)[: count * length].reshape(count, length).all(axis=1)
    means = thrust[: count * length].reshape(count, length, 4).mean(axis=1)
    edges = record.rate[: count * length + 1 : length]
    turns = np.diff(edges, axis=0) / (length * record.dt)
    if not rows.any():
        return np.empty((0, 4)), np.empty((0, 3))
    return means[rows] - means[rows].mean(axis=0), turns[rows] - turns[rows].mean(axis=0)


def _correlation(thrust: FloatArray, turn: FloatArray, axes: slice) -> float:
    """Of moments with angular accelerations, mean over these axes; 0 where one of them does not move."""
    moments, turns = thrust @ np.array([ROLL, PITCH, YAW])[axes].T, turn[:, axes]
    sizes = np.sqrt(np.sum(moments**2, axis=0) * np.sum(turns**2, axis=0))
    if not np.all(sizes > 0.0):
        return 0.0
    return float(np.mean(np.sum(moments * turns, axis=0) / sizes))
